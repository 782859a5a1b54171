"""The C++ core, built with AddressSanitizer and UndefinedBehaviorSanitizer."""

import os
import subprocess
import sys
import sysconfig
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import nanobind

NATIVE = Path(__file__).parents[2] / "pipeline" / "kernels" / "native"
#: As in CMakeLists.txt, without optimisation that hides accesses; every finding ends the process.
FLAGS = [
    "-std=c++20",
    "-O1",
    "-g",
    "-fPIC",
    "-fno-omit-frame-pointer",
    "-ffp-contract=off",
    "-DNDEBUG",
    "-fvisibility=hidden",
]
SANITIZE = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]


def build(folder: Path) -> Path:
    """Compile into `folder`; the module's file. Takes minutes."""
    places = Path(nanobind.include_dir()).parent
    include = [f"-I{place}" for place in (nanobind.include_dir(), places / "ext" / "robin_map" / "include")]
    include.append(f"-I{sysconfig.get_path('include')}")
    sources = [*sorted(NATIVE.glob("*.cpp")), places / "src" / "nb_combined.cpp"]

    def compiled(source: Path) -> Path:
        made = folder / f"{source.stem}.o"
        # Of nanobind only the memory is watched: its tables are no part of what is tested.
        sanitize = SANITIZE if source.parent == NATIVE else ["-fsanitize=address"]
        subprocess.run(
            ["g++", *FLAGS, *sanitize, *include, "-DNB_COMPACT_ASSERTIONS", "-c", source, "-o", made],
            check=True,
        )
        return made

    with ThreadPoolExecutor(2) as pool:
        objects = list(pool.map(compiled, sources))
    module = folder / f"core{sysconfig.get_config_var('EXT_SUFFIX')}"
    subprocess.run(["g++", "-shared", *SANITIZE, *objects, "-o", module, "-pthread"], check=True)
    return module


def run(module: Path, *arguments: str) -> "subprocess.CompletedProcess[str]":
    """`tests.support.fuzzed_bindings` with this core, under the sanitizers."""
    libraries = [
        subprocess.run(
            ["g++", f"-print-file-name={name}"], check=True, capture_output=True, text=True
        ).stdout.strip()
        for name in ("libasan.so", "libubsan.so", "libstdc++.so")
    ]
    environment = {
        **os.environ,
        "LD_PRELOAD": " ".join(libraries),
        # Python keeps memory to its end, and a size that cannot be had is an exception, not a finding.
        "ASAN_OPTIONS": "detect_leaks=0:allocator_may_return_null=1:detect_container_overflow=0",
        "UBSAN_OPTIONS": "print_stacktrace=1",
    }
    command = [sys.executable, "-m", "tests.support.fuzzed_bindings", "--core", str(module), *arguments]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
