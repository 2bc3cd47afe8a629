"""Installation of emd_planner."""

from setuptools import find_packages, setup

setup(
    name="emd_planner",
    version="0.1.0",
    packages=find_packages(),
    package_data={"emd_planner": ["py.typed", "weights/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/emd_planner"]),
        ("share/emd_planner", ["package.xml"]),
    ],
    entry_points={
        "console_scripts": [
            "planner_node = emd_planner.ros.planner_node:main",
        ]
    },
    install_requires=["setuptools"],
    zip_safe=True,
    license="Apache-2.0",
)
