from thenar.runtime.names import list_names, nearest


def test_near_names_are_suggested_or_else_the_first_there_are() -> None:
    assert nearest("subjct", ["subject", "object"]).startswith(" (did you mean 'subject'")
    assert nearest("zzz", ["subject", "object"]) == " (there are: subject, object)"


def test_long_lists_are_cut_and_counted() -> None:
    assert list_names(["a", "b"]) == "a, b"
    assert list_names([*"abcdefg"]) == "a, b, c, d, e and 2 more"
    assert list_names([*"abcde"], 12) == "a, b, c, d, e and 7 more"
