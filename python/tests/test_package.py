"""The package itself: version, stubs and docstrings."""

import ast
import dataclasses
import importlib
import inspect
import json
import pathlib
import re
import subprocess
import sys

import pytest

import hydrograd as hg
from hydrograd import _hydrograd

ROOT = pathlib.Path(__file__).parents[2]
STUBS = pathlib.Path(hg.__file__).with_name("_hydrograd.pyi")


def public(names):
    return {name for name in names if not name.startswith("_")}


def stubbed():
    """Names of the stubs, with those of each class."""
    out = {}
    for node in ast.parse(STUBS.read_text()).body:
        if isinstance(node, ast.ClassDef):
            out[node.name] = {item.name for item in node.body if isinstance(item, ast.FunctionDef)}
        elif isinstance(node, ast.FunctionDef):
            out[node.name] = node
    return out


def test_every_name_has_a_stub_and_every_stub_a_name():
    stubs = stubbed()
    assert public(stubs) == public(dir(_hydrograd))
    for name in public(stubs):
        members = stubs[name]
        value = getattr(_hydrograd, name)
        if inspect.isclass(value) and not issubclass(value, Exception):
            assert public(members) == public(vars(value)), name


def test_classes_say_where_they_are():
    for name in public(dir(_hydrograd)):
        value = getattr(_hydrograd, name)
        if inspect.isclass(value):
            assert getattr(importlib.import_module(value.__module__), name) is value, name


def test_the_command_runs_and_says_how_it_ended():
    """The whole command line is tested from Rust; here that it is there, passes its arguments on and gives its exit code."""

    def run(*arguments):
        return subprocess.run([sys.executable, "-m", "hydrograd", *arguments], capture_output=True, text=True, check=False)

    assert run("--version").stdout == f"hydrograd {hg.__version__}\n"
    shape = run("added-mass", "--shape", "sphere:1", "--density", "1", "--json")
    first = json.loads(shape.stdout)
    assert shape.returncode == 0 and not first.get("error")
    unknown = run("rum")
    assert unknown.returncode == 2 and "rum" in unknown.stderr
    missing = run("run", "nowhere.toml")
    assert missing.returncode == 1 and "nowhere.toml" in missing.stderr


def test_options_of_the_stubs_are_those_of_the_program():
    """Every option that takes a name takes the same names in the stubs; a wrong one's error lists them."""
    lists = {
        node.targets[0].id: ast.literal_eval(node.value.slice)
        for node in ast.parse(STUBS.read_text()).body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Subscript) and node.value.value.id == "Literal"
    }
    keywords = {"fidelity": "_Fidelity", "method": "_Method", "integrator": "_Integrator", "backend": "_Backend"}
    for keyword, name in keywords.items():
        with pytest.raises(hg.InputError, match="must be one of") as error:
            hg.Simulator(hg.Scene(), **{keyword: "?"})
        listed = str(error.value).split("must be one of ")[1]
        assert tuple(re.findall('"([^"]+)"', listed)) == lists[name], keyword


def test_keywords_are_those_of_the_stubs():
    def keywords(node):
        a = node.args
        return [x.arg for x in a.posonlyargs + a.args + a.kwonlyargs if x.arg not in ("self", "cls")]

    for node in ast.walk(ast.parse(STUBS.read_text())):
        if isinstance(node, ast.ClassDef) and not node.name.startswith("_") and hasattr(hg, node.name):
            owner = getattr(hg, node.name)
            for item in node.body:
                if not isinstance(item, ast.FunctionDef) or any(
                    isinstance(d, ast.Name) and d.id == "property" for d in item.decorator_list
                ):
                    continue
                target = owner if item.name == "__new__" else getattr(owner, item.name)
                if item.name.startswith("__") and item.name != "__new__":
                    continue
                parameters = inspect.signature(target).parameters.values()
                found = [p.name for p in parameters if p.name != "self" and p.kind is not p.VAR_KEYWORD]
                stub = keywords(item)
                if any(p.kind is p.VAR_KEYWORD for p in parameters):
                    # Keywords that depend on the kind stand in the stub alone.
                    assert len(stub) > len(found), f"{node.name}.{item.name}"
                    stub = stub[: len(found)]
                assert found == stub, f"{node.name}.{item.name}"
    for name, node in stubbed().items():
        if isinstance(node, ast.FunctionDef):
            parameters = inspect.signature(getattr(_hydrograd, name)).parameters.values()
            found = [p.name for p in parameters if p.kind is not p.VAR_KEYWORD]
            open_ended = len(found) < len(parameters)
            assert found == (keywords(node)[: len(found)] if open_ended else keywords(node)), name


def test_everything_is_documented():
    for name in public(dir(hg)) & set(hg.__all__):
        value = getattr(hg, name)
        assert (value.__doc__ or "").strip(), name
        if inspect.isclass(value) and not issubclass(value, Exception):
            for member in public(vars(value)):
                if dataclasses.is_dataclass(value):
                    continue  # data classes document their fields beside them
                assert (getattr(value, member).__doc__ or "").strip(), f"{name}.{member}"
    for module in (hg.objective, hg.optimize):
        for name in module.__all__:
            assert (getattr(module, name).__doc__ or "").strip(), name


def test_version_is_that_of_the_crate():
    text = (ROOT / "Cargo.toml").read_text()
    found = re.search(r'^\[workspace.package\]\nversion = "([^"]+)"', text, re.MULTILINE)
    assert hg.__version__ == found[1]
    assert STUBS.with_name("py.typed").exists()


def test_docstrings_stand_in_the_stubs():
    check = subprocess.run([sys.executable, ROOT / ".ci/stubs", "--check"], capture_output=True, text=True, check=False)
    assert check.returncode == 0, check.stderr


def test_signatures_are_readable():
    for name in hg.__all__:
        value = getattr(hg, name)
        members = [value] + ([getattr(value, m) for m in public(vars(value))] if inspect.isclass(value) else [])
        for member in members:
            if callable(member) and not (inspect.isclass(member) and issubclass(member, Exception)):
                assert "Ellipsis" not in str(inspect.signature(member)), f"{name}: {member}"


def test_readme():
    """The example of the README runs and cuts the miss tenfold."""
    blocks = re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(), re.MULTILINE | re.DOTALL)
    assert blocks
    names = {}
    exec(blocks[0], names)
    shown = re.search(r"print\(.*# (\S+) after", blocks[0])[1]
    assert names["best"].fun == pytest.approx(float(shown), rel=0.5)
    start, _ = names["cost_and_gradient"](0 * names["best"].x)
    # The squared miss: a tenfold cut of the miss is a hundredfold one of the cost.
    assert names["best"].fun < start / 100
