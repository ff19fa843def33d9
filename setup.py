"""What msahl depends on, and its machine code; all else about the package is in pyproject.toml.

``make wheel`` puts the machine code of all kernels into the package. Such a wheel is for one
platform and needs no compiler. Every other installation needs numba and compiles what a run needs
when it needs it.
"""

import platform
import sys
import sysconfig
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
HAS_KERNELS = Path("msahl/kernels").is_dir()


def platform_tag():
    """Return the platform of a wheel with machine code, as installers name it."""
    if sys.platform == "linux" and HAS_KERNELS:  # the code needs nothing but libm
        return f"manylinux_2_17_{platform.machine()}"
    return sysconfig.get_platform().replace("-", "_").replace(".", "_")


if HAS_KERNELS:
    setup(install_requires=ALWAYS, options={"bdist_wheel": {"plat_name": platform_tag()}})
else:
    setup(install_requires=[*ALWAYS, COMPILER])
