"""Installation of emd_console."""

from setuptools import find_packages, setup

setup(
    name="emd_console",
    version="0.1.0",
    packages=find_packages(),
    package_data={"emd_console": ["py.typed", "report.html.j2"], "emd_console.web": ["static/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/emd_console"]),
        ("share/emd_console", ["package.xml"]),
    ],
    entry_points={
        "console_scripts": [
            "console_node = emd_console.ros.console_main:main",
        ]
    },
    install_requires=["setuptools"],
    zip_safe=True,
    license="Apache-2.0",
)
