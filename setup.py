"""What msahl depends on; all else about the package is in pyproject.toml.

``make wheel`` puts the machine code of all kernels into the package. A wheel with machine code is
for one platform and needs no compiler; every other installation compiles, so it needs numba.
"""

from pathlib import Path

from setuptools import setup

ALWAYS = [
    "click>=8.1",
    "llvmlite>=0.48",
    "lxml>=5.0",
    "matplotlib>=3.8",
    "numpy>=1.26",
    "orjson>=3.9",
    "pandas>=2.1",
    "platformdirs>=4.0",
    "scipy>=1.11",
    "xmlschema>=4.0",
]
COMPILER = "numba>=0.66,<0.69"  # msahl/jit/machine_code.py extends its insides
PLATFORM = {"bdist_wheel": {"plat_name": "manylinux_2_17_x86_64"}}

if Path("msahl/kernels").is_dir():
    setup(install_requires=ALWAYS, options=PLATFORM)
else:
    setup(install_requires=[*ALWAYS, COMPILER])
