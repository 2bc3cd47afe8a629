"""Installation of emd_cloth_sim."""

from setuptools import find_packages, setup

setup(
    name="emd_cloth_sim",
    version="0.1.0",
    packages=find_packages(),
    package_data={"emd_cloth_sim": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/emd_cloth_sim"]),
        ("share/emd_cloth_sim", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    extras_require={"ray": ["ray==2.60.0"]},
    zip_safe=True,
    license="Apache-2.0",
)
