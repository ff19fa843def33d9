"""Work hands out points, takes rows in any order, and follows the policy for failures."""

import pytest

from msahl.sweep.faults import PlanError
from msahl.sweep.sweep import carry_out
from msahl.sweep.work import OnFail, Work, parse_on_fail
from tests.sweep.fakes import FakeScheduler, open_store, row_of, sweep


@pytest.fixture
def make(tmp_path):
    stores = []

    def made(**more):
        of = sweep(tmp_path / "s", "L=60:100:5 cm")
        stores.append(open_store(tmp_path / "s", of))
        return Work(of.plan, stores[-1], **more)

    yield made
    for store in stores:
        store.close()


def test_points_are_handed_out_once_and_rows_come_in_any_order(make):
    work = make()
    points = work.next(2) + work.next(10)
    assert [point.number for point in points] == [1, 2, 3, 4, 5]
    assert work.next(1) == []
    assert not work.finished
    work.take([row_of(point) for point in reversed(points)])
    work.take([row_of(points[0])])  # brought twice: by a worker that was thought dead
    assert work.finished
    assert work.counts.done == 5


def test_points_given_back_are_handed_out_again(make):
    work = make()
    points = work.next(5)
    work.take([row_of(points[0])])
    work.give_back(points)
    assert [point.number for point in work.next(5)] == [2, 3, 4, 5]


def test_continue_goes_on(tmp_path):
    scheduler = FakeScheduler({2: 1, 4: 1})
    counts = carry_out(sweep(tmp_path / "s", "L=60:100:5 cm"), scheduler)
    assert scheduler.ran == [1, 2, 3, 4, 5]
    assert counts.statuses == {"completed": 3, "not converged": 2}
    assert counts.first_failure == "point 2: not converged: it diverged"


def test_stop_ends_the_sweep_at_the_first_failure(tmp_path):
    made = sweep(tmp_path / "s", "L=60:100:5 cm", on_fail=OnFail("stop"))
    scheduler = FakeScheduler({2: 1})
    counts = carry_out(made, scheduler)
    assert scheduler.ran == [1, 2]
    assert (counts.done, counts.failed) == (2, 1)


@pytest.mark.parametrize(("fails", "tries", "failed"), [(1, 2, 0), (2, 3, 0), (3, 3, 1)])
def test_retry_tries_so_often(tmp_path, fails, tries, failed):
    made = sweep(tmp_path / "s", "L=60:100:5 cm", on_fail=OnFail("retry", 2))
    scheduler = FakeScheduler({5: fails})
    counts = carry_out(made, scheduler)
    assert scheduler.ran.count(5) == tries
    assert counts.failed == failed
    again = FakeScheduler()
    carry_out(made, again)
    assert again.ran == []


def test_policies_by_name():
    assert parse_on_fail("continue") == OnFail()
    assert parse_on_fail("stop") == OnFail("stop")
    assert parse_on_fail("retry:3") == OnFail("retry", 3)
    for text in ("", "halt", "retry", "retry:0", "retry:x", "retry:-1", "stop:1", "retry:²"):
        with pytest.raises(PlanError, match="--on-fail"):
            parse_on_fail(text)
