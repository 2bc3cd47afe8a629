"""Installation of emd_arm_executor."""

from setuptools import find_packages, setup

setup(
    name="emd_arm_executor",
    version="0.1.0",
    packages=find_packages(),
    package_data={
        "emd_arm_executor": ["py.typed"],
        "emd_arm_executor.dual_arm": ["dual_arm.urdf", "dual_arm.yaml"],
        "emd_arm_executor.hiro": ["hiro.urdf", "hiro.yaml"],
    },
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/emd_arm_executor"]),
        ("share/emd_arm_executor", ["package.xml"]),
    ],
    entry_points={
        "console_scripts": [
            "executor_node = emd_arm_executor.ros.executor_node:main",
        ]
    },
    install_requires=["setuptools"],
    zip_safe=True,
    license="Apache-2.0",
)
