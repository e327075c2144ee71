"""The package of every target, taken as each ecosystem takes it: by CMake, and by the tools that read its manifests."""

import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace
from ruamel.yaml import YAML

from thenar.compiler.firmware.classifier import Library
from thenar.compiler.firmware.layout import Layout
from thenar.compiler.firmware.targets import TARGETS
from thenar.compiler.firmware.targets.package import Package

from ....conftest import tool
from ....tables import describe
from ..conftest import make_tables

Written = Callable[..., Path]

PACKAGES = [name for name, target in TARGETS.items() if isinstance(target, Package)]
STRICT = "-std=c99 -Wall -Wextra -Wconversion -pedantic -Werror -O2"
ARM, RISCV, XTENSA = "arm-none-eabi-gcc", "riscv64-unknown-elf-gcc", "xtensa-lx106-elf-gcc"
HARD_FLOAT = "-mthumb -mfloat-abi=hard"
# The family's cores, and what its SDK calls our CMakeLists.txt by.
BOARDS = {
    "ESP32, Xtensa": ("esp32", "esp-idf", XTENSA, "-mlongcalls"),
    "ESP32-C3": ("esp32c3", "esp-idf", RISCV, "-march=rv32imc -mabi=ilp32"),
    "RP2040": ("rp2040", "cmake", ARM, "-mcpu=cortex-m0plus -mthumb"),
    "RP2350, Arm": ("rp2350", "cmake", ARM, f"-mcpu=cortex-m33 {HARD_FLOAT} -mfpu=fpv5-sp-d16"),
    "RP2350, RISC-V": ("rp2350", "cmake", RISCV, "-march=rv32imac -mabi=ilp32"),
    "nRF52840": ("nrf52", "zephyr", ARM, f"-mcpu=cortex-m4 {HARD_FLOAT} -mfpu=fpv4-sp-d16"),
    "STM32F0": ("stm32", "cmake", ARM, "-mcpu=cortex-m0 -mthumb"),
    "STM32F1": ("stm32", "zephyr", ARM, "-mcpu=cortex-m3 -mthumb"),
    "STM32H7": ("stm32", "cmake", ARM, f"-mcpu=cortex-m7 {HARD_FLOAT} -mfpu=fpv5-d16"),
    "generic, 64 bits": ("generic", "cmake", RISCV, "-march=rv64imac -mabi=lp64 -mcmodel=medany"),
}
# What the SDKs define for a component and a module, as far as a library needs it.
SDK = {
    "cmake": "add_subdirectory(thenar_hand)\ntarget_link_libraries(glove thenar_hand)\n",
    "esp-idf": """\
function(idf_component_register)
    cmake_parse_arguments(given "" "" "SRCS;INCLUDE_DIRS" ${ARGN})
    add_library(__idf_thenar_hand STATIC ${given_SRCS})
    target_include_directories(__idf_thenar_hand PUBLIC ${given_INCLUDE_DIRS})
endfunction()
add_subdirectory(thenar_hand)
target_link_libraries(glove __idf_thenar_hand)
""",
    "zephyr": """\
add_library(zephyr_interface INTERFACE)
macro(zephyr_library_named name)
    set(ZEPHYR_CURRENT_LIBRARY ${name})
    add_library(${name} STATIC "")
endmacro()
function(zephyr_library_sources)
    target_sources(${ZEPHYR_CURRENT_LIBRARY} PRIVATE ${ARGN})
endfunction()
function(zephyr_include_directories folder)
    target_include_directories(zephyr_interface INTERFACE ${CMAKE_CURRENT_SOURCE_DIR}/${folder})
endfunction()
add_subdirectory(thenar_hand)
target_link_libraries(glove zephyr_interface thenar_hand)
""",
}
PROJECT = """\
cmake_minimum_required(VERSION 3.15)
project(glove C ASM)
add_library(glove STATIC glove.c)
target_include_directories(glove PRIVATE thenar_hand/check)
"""
PROGRAM = """\
#include "thenar_hand_check.h"
unsigned glove_works(void);
unsigned glove_works(void) { return thenar_hand_check(); }
"""


@pytest.fixture
def written(tmp_path: Path) -> Written:
    """Return what writes the package "hand" of a target."""

    def written(target: str, grasp: str = "grasp 0") -> Path:
        tables = make_tables()
        manifest = describe(tables)
        named = replace(manifest, grasps=(grasp, *manifest.grasps[1:]))
        for name, text in TARGETS[target].files(Library("hand", named, Layout(tables))).items():
            path = tmp_path / "thenar_hand" / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text)
        return tmp_path / "thenar_hand"

    return written


def run(*command: object) -> str:
    done = subprocess.run([*map(str, command)], capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def built(cmake: str, source: Path, *options: object) -> Path:
    """Return the folder in which CMake has built what is in another."""
    out = source.with_name(f"{source.name}_out")
    run(cmake, "-S", source, "-B", out, *options)
    run(cmake, "--build", out)
    return out


@pytest.mark.slow
@pytest.mark.parametrize("board", list(BOARDS))
def test_every_board_s_compiler_takes_its_package_through_the_sdk_s_cmake(
    written: Written, tmp_path: Path, board: str
) -> None:
    target, sdk, compiler, flags = BOARDS[board]
    assert {path.suffix for path in (written(target) / "src").iterdir()} == {".c", ".h"}
    (tmp_path / "CMakeLists.txt").write_text(PROJECT + SDK[sdk])
    (tmp_path / "glove.c").write_text(PROGRAM)
    machine = ("-DCMAKE_SYSTEM_NAME=Generic", "-DCMAKE_TRY_COMPILE_TARGET_TYPE=STATIC_LIBRARY")
    given = (f"-DCMAKE_C_COMPILER={tool(compiler)}", f"-DCMAKE_C_FLAGS={flags} {STRICT} -ffreestanding")
    out = built(tool("cmake"), tmp_path, *machine, *given)
    (archive,) = out.rglob("lib*thenar_hand.a")
    symbols = run(tool(compiler.replace("gcc", "nm")), archive)
    assert "T thenar_classify" in symbols
    assert "f2d" not in symbols  # no floating point, not even in software
    assert (out / "libglove.a").exists()


@pytest.mark.slow
def test_the_package_builds_tests_itself_and_installs(written: Written, tmp_path: Path) -> None:
    cmake = tool("cmake")
    out = built(cmake, written("generic"), f"-DCMAKE_C_FLAGS={STRICT}")
    assert "100% tests passed" in run(tool("ctest"), "--test-dir", out)
    run(cmake, "--install", out, "--prefix", tmp_path / "there")
    user = tmp_path / "user"
    user.mkdir()
    (user / "main.c").write_text(
        '#include "thenar_hand.h"\n#include <string.h>\n'
        "int main(void)\n{\n    char name[THENAR_HAND_NAME_BYTES];\n\n"
        "    (void)thenar_name(&thenar_hand_model, 0, name, sizeof name);\n"
        '    return strcmp(name, "grasp 0");\n}\n'
    )
    (user / "CMakeLists.txt").write_text(
        "cmake_minimum_required(VERSION 3.15)\nproject(user C)\nfind_package(thenar_hand 1.0 CONFIG REQUIRED)\n"
        "add_executable(user main.c)\ntarget_link_libraries(user thenar::thenar_hand)\n"
    )
    run(built(cmake, user, f"-DCMAKE_PREFIX_PATH={tmp_path / 'there'}") / "user")


def test_platformio_packs_the_library(written: Written, tmp_path: Path) -> None:
    made = written("generic")
    packing = (  # it asks the network for the list of licences
        "from platformio.package.manifest.schema import ManifestSchema\n"
        "from platformio.package.pack import PackagePacker\n"
        "ManifestSchema.load_spdx_licenses = staticmethod(lambda: {'licenses': [{'licenseId': 'MIT'}]})\n"
        f"print(PackagePacker({str(made)!r}).pack({str(tmp_path)!r}))\n"
    )
    packed = run(sys.executable, "-c", packing).splitlines()[-1]
    assert packed == str(tmp_path / "thenar_hand-1.0.0.tar.gz")
    assert "src/thenar_hand.c\n" in run("tar", "tzf", packed)


def test_espressif_s_component_manager_takes_the_manifest(written: Written) -> None:
    made = written("esp32")
    reading = (
        "from idf_component_tools.manager import ManifestManager\n"
        f"read = ManifestManager({str(made)!r}, 'thenar_hand').validate()\n"
        "said = read.manifest.version, read.manifest.license, read.manifest.description\n"
        "print(*read.validation_errors, *said, sep='\\n')\n"
    )
    assert run(sys.executable, "-c", reading).splitlines() == [
        "1.0.0",
        "MIT",
        "Recognises 5 grasp types from 9 switches and 3 joints of a glove.",
    ]


def test_zephyr_finds_cmake_where_the_module_says_it_is(written: Written) -> None:
    made = written("nrf52")
    module = YAML(typ="safe").load((made / "zephyr/module.yml").read_text())
    assert (module.keys(), module["build"].keys()) == ({"name", "build"}, {"cmake"})
    assert (made / module["build"]["cmake"] / "CMakeLists.txt").is_file()


def test_no_ecosystem_needs_more_than_eight_files(written: Written) -> None:
    paths = {path.relative_to(written("generic")).parts for path in written("generic").rglob("*") if path.is_file()}
    assert len([parts for parts in paths if parts[0] not in ("src", "check")]) <= 8


@pytest.mark.parametrize("target", PACKAGES)
def test_every_package_says_how_each_ecosystem_takes_it_and_under_which_licence(written: Written, target: str) -> None:
    made = written(target, grasp="*/ *bold*\n# no heading")
    text = (made / "README.md").read_text()
    for ecosystem in ("Arduino", "PlatformIO", "ESP-IDF", "Zephyr", "pico-sdk", "CMake", "STM32CubeIDE", "Self test"):
        assert ecosystem in text
    assert "\n# no heading" not in text
    licence = (Path(__file__).parents[4] / "LICENSE").read_text()
    assert (made / "LICENSE").read_text() == licence


def test_the_program_in_the_readme_compiles(written: Written, tmp_path: Path) -> None:
    made = written("generic")
    lines = re.findall(r"^    (.*)$", (made / "README.md").read_text().partition("## Use in each")[0], re.MULTILINE)
    included, shown = ([line for line in lines if line.startswith("#") == is_one] for is_one in (True, False))
    given = "unsigned f(uint16_t number, bool closed, uint16_t sensor, int32_t reading)"
    (tmp_path / "f.c").write_text("\n".join([*included, f"{given};", given, "{", *shown, "return grasp;", "}", ""]))
    run(tool("gcc"), *STRICT.split(), f"-I{made / 'src'}", "-c", tmp_path / "f.c", "-o", tmp_path / "f.o")


def test_a_package_costs_what_its_core_does() -> None:
    cores = {
        "cortex-m0plus": ["rp2040"],
        "cortex-m4": ["esp32", "esp32s2", "esp32s3", "rp2350", "nrf52", "stm32", "generic"],
        "rv32imac": ["esp32c3", "esp32c6"],
    }
    for core, names in cores.items():
        assert all(TARGETS[name].formula is TARGETS[core].formula for name in names)
