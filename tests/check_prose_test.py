#!/usr/bin/env python3
"""scripts/check_prose finds paragraphs, pages and a README's sentences that are too long, and none that are not.

    tests/check_prose_test.py SOURCE
"""
import sys

from script_cases import run_cases

PARAGRAPH, PAGE = 90, 1500


def words(count):
    """Sentences of nine words."""
    return " ".join("word." if i % 9 == 8 else "Word" if i % 9 == 0 else "word" for i in range(count))


def page(count):
    """Paragraphs of fifty words."""
    return "\n\n".join([words(50)] * (count // 50) + [words(count % 50)])


def sentence(count):
    """One of as many words, among short ones."""
    return "Word " + "word " * (count - 2) + "word. " + words(27)


LONG = ["a paragraph of 91 words, 90 at most: Word word"]
CASES = [
    ("a paragraph of 90 words", words(PARAGRAPH), []),
    ("one of 91", words(PARAGRAPH + 1), LONG),
    ("one of 91 on several lines", words(PARAGRAPH + 1).replace(". ", ".\n"), LONG),
    ("an item of a list", "- " + words(PARAGRAPH), ["a paragraph of 91 words"]),
    ("items of a list", "\n".join(["- " + words(60)] * 3), []),
    ("numbered items", "\n".join(["1. " + words(60)] * 3), []),
    ("a text before a list", words(60) + "\n\n- " + words(60), []),
    ("a row of a table", "| a | b |\n|---|---|\n| " + words(91) + " | |\n", ["a paragraph of 91 words"]),
    ("rows of a table", "| a | b |\n|---|---|\n" + ("| " + words(60) + " | b |\n") * 3, []),
    ("a heading", "# " + words(50) + "\n" + words(50), []),
    ("a fence", "```\n" + words(200) + "\n```\n", []),
    ("a formula", "$$\n" + words(200) + "\n$$\n", []),
    ("a comment", "<!-- " + words(200) + " -->\n", []),
    ("the address of a link is no word", words(PARAGRAPH - 1) + " [word](a b c)", []),
    ("a page of 1500 words", page(PAGE), []),
    ("one of 1501", page(PAGE + 1), ["the page has 1501 words, 1500 at most"]),
    ("a page with a long fence", page(PAGE) + "\n\n```\n" + words(200) + "\n```\n", []),
    ("a page that a program writes", "<!-- Written by scripts/generate_reference -->\n" + words(91), []),
    ("a sentence of 40 words", sentence(40), []),
    ("one of 41", sentence(41), ["41 words, 40 at most: Word word"]),
    ("a sentence of 30 words in a README", sentence(30), [], "README.md"),
    ("one of 31", sentence(31), ["31 words, 30 at most: Word word"], "README.md"),
]


if __name__ == "__main__":
    sys.exit(run_cases("check_prose", "case.md", CASES))
