"""The tree of errors that the docstring draws is the tree of the classes."""

import re

from miurafab import errors


def below(parent):
    children = [child for child in parent.__subclasses__() if child.__module__ == errors.__name__]
    return {child: below(child) for child in children}


def listed(tree, depth=0):
    for cls, children in tree.items():
        yield depth, cls.__name__, cls.exit_code
        yield from listed(children, depth + 1)


def test_the_drawn_tree_is_that_of_the_classes():
    drawn, codes = [], {}
    for indent, name, code in re.findall(
        r"^    ([├└│─ ]*)([A-Z]\w+)(?: \[(\d+)\])?(?= |$)", errors.__doc__, re.MULTILINE
    ):
        depth = len(indent) // 4
        codes[depth] = int(code) if code else codes.get(depth - 1, errors.BAD_INPUT)
        drawn.append((depth, name, codes[depth]))
    assert len(drawn) > 12
    assert sorted(drawn) == sorted(listed({errors.MiurafabError: below(errors.MiurafabError)}))
