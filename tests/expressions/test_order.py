"""Named expressions in the order in which they can be evaluated, and circles among them."""

from msahl.expressions.order import MOST_SHOWN, in_order, shown_circle


def test_each_name_comes_after_those_it_depends_on():
    graph = {"c": {"a", "b"}, "b": {"a"}, "a": set()}
    assert in_order(graph) == (["a", "b", "c"], [])


def test_circles_are_found_and_the_rest_is_ordered():
    graph = {"free": set(), "a": {"b"}, "b": {"c"}, "c": {"b"}, "own": {"own", "free"}}
    order, circles = in_order(graph)
    assert order == ["free"]
    assert circles == [["b", "c", "b"], ["own", "own"]]  # to which "a" leads, too


def test_a_long_circle_is_cut_in_a_message():
    assert shown_circle(["a", "b", "a"]) == "a -> b -> a"
    long = [str(k) for k in range(MOST_SHOWN + 5)]
    assert shown_circle(long).endswith(f"-> {MOST_SHOWN - 1} -> ...")
