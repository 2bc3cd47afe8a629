"""Installation of emd_core."""

from setuptools import find_packages, setup

setup(
    name="emd_core",
    version="0.1.0",
    packages=find_packages(),
    package_data={"emd_core": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/emd_core"]),
        ("share/emd_core", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    license="Apache-2.0",
)
