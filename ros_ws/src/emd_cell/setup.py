"""Installation of emd_cell."""

from setuptools import find_packages, setup

setup(
    name="emd_cell",
    version="0.1.0",
    packages=find_packages(),
    package_data={"emd_cell": ["py.typed", "*.xml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/emd_cell"]),
        ("share/emd_cell", ["package.xml"]),
    ],
    entry_points={
        "console_scripts": [
            "simulation_node = emd_cell.ros.simulation_main:main",
            "recorder_node = emd_cell.ros.recorder_node:main",
            "cell = emd_cell.cli:main",
        ]
    },
    install_requires=["setuptools"],
    zip_safe=True,
    license="Apache-2.0",
)
