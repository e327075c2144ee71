"""docs/how-to/firmware.md: its programs in Rust and WebAssembly call the C library, and print Python's grasp."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from thenar.compiler.firmware.generate import Firmware
from thenar.compiler.firmware.tools import call
from thenar.runtime.build import Build
from thenar.runtime.manifest import Manifest
from thenar.runtime.model.integers import IntegerTables

PAGE = Path(__file__).parents[4] / "docs" / "how-to" / "firmware.md"

# What the page uses of the crate `cc`, which needs a registry.
CC = r"""
use std::{env, process::Command};
#[derive(Default)]
pub struct Build { command: Vec<String>, sources: Vec<String> }
impl Build {
    pub fn new() -> Self { Self::default() }
    pub fn include(&mut self, folder: &str) -> &mut Self { self.command.push(format!("-I{folder}")); self }
    pub fn files<const N: usize>(&mut self, paths: [&str; N]) -> &mut Self {
        self.sources.extend(paths.map(String::from));
        self
    }
    pub fn compile(&mut self, name: &str) {
        let folder = env::var("OUT_DIR").unwrap();
        let mut objects = Vec::new();
        for (number, source) in self.sources.iter().enumerate() {
            objects.push(format!("{folder}/{number}.o"));
            let made = ["-O2", "-c", source, "-o", &objects[number]];
            assert!(Command::new("gcc").args(&self.command).args(made).status().unwrap().success());
        }
        let archive = format!("{folder}/lib{name}.a");
        assert!(Command::new("ar").args(["rcs", &archive]).args(&objects).status().unwrap().success());
        println!("cargo:rustc-link-search=native={folder}\ncargo:rustc-link-lib=static={name}");
    }
}
"""
CARGO = """
[package]
name = "recognise"
edition = "2021"
[build-dependencies]
cc = "1"
"""
CC_TOML = '[package]\nname = "cc"\nversion = "1.0.0"\nedition = "2021"\n[lib]\npath = "lib.rs"\n'


@pytest.mark.slow
def test_the_programs_of_the_page_print_python_s_grasp(
    tool: Callable[[str], str],
    make_tables: Callable[..., IntegerTables],
    describe: Callable[[IntegerTables], Manifest],
    tmp_path: Path,
) -> None:
    tables = make_tables()
    manifest = describe(tables)
    files = {f"glove/{path}": text for path, text in Firmware(tables, manifest, "host").files().items()}
    files |= dict(re.findall(r'```\w+ title="(.*?)"\n(.*?)```', PAGE.read_text(encoding="utf-8"), re.DOTALL))
    for path, text in (files | {"Cargo.toml": CARGO, "cc/lib.rs": CC, "cc/Cargo.toml": CC_TOML}).items():
        (tmp_path / path).parent.mkdir(exist_ok=True)
        (tmp_path / path).write_text(text)
    codes = np.array([120] + [0] * (tables.n_joints - 1), np.uint16)
    scores = Build(manifest, tables).scores(np.arange(tables.n_switches) == 0, codes)
    grasp = f"{manifest.grasps[int(scores.argmax())]}\n".encode()

    cargo = [tool("cargo"), "run", "--quiet", "--offline", "--config", 'patch.crates-io.cc.path="cc"']
    assert call(cargo, tmp_path) == grasp
    tool("clang")
    tool("wasm-ld")
    call(["sh", "-e", "build.sh"], tmp_path)
    assert call([tool("node"), "recognise.mjs"], tmp_path) == grasp
