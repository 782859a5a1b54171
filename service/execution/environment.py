"""The environment variables of the processes that read untrusted meshes.

Passwords and keys may have any name, so only variables that are needed are passed.
"""

import os
import re

KEPT = {"PATH", "HOME", "LANG", "LANGUAGE", "TZ", "TMPDIR", "LD_LIBRARY_PATH", "VIRTUAL_ENV", "MPLCONFIGDIR"}
KEPT_FAMILIES = re.compile(r"(LC|PYTHON|XDG|FONTCONFIG|OPENBLAS|OMP|MALLOC|LIBGL|MESA)\w*|\w+_NUM_THREADS")


def kept_environment() -> dict[str, str]:
    """The environment variables that a zygote gets."""
    return {
        name: value for name, value in os.environ.items() if name in KEPT or KEPT_FAMILIES.fullmatch(name)
    }
