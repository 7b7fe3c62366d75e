"""Each public name has an example in its docstring, and the example does what it says."""

import doctest

import pytest

import wm_drake


@pytest.mark.parametrize("name", wm_drake.__all__)
def test_a_public_name_has_an_example_that_holds(name):
    examples = doctest.DocTestFinder(recurse=False).find(getattr(wm_drake, name), name, globs={})
    assert sum(len(example.examples) for example in examples) > 0
    for example in examples:
        assert doctest.DocTestRunner(verbose=False).run(example).failed == 0
