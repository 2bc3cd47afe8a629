"""Installation of emd_perception."""

from setuptools import find_packages, setup

setup(
    name="emd_perception",
    version="0.1.0",
    packages=find_packages(),
    package_data={"emd_perception": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/emd_perception"]),
        ("share/emd_perception", ["package.xml"]),
    ],
    entry_points={
        "console_scripts": [
            "perception_node = emd_perception.ros.perception_node:main",
        ]
    },
    install_requires=["setuptools"],
    zip_safe=True,
    license="Apache-2.0",
)
