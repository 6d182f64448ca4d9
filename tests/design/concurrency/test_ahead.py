"""Work that is begun ahead: its results in order, its errors in their place, none of it for who has stopped asking."""

import threading

import pytest

from scanwright.design.concurrency.ahead import ahead


def test_results_come_in_order():
    assert list(ahead(lambda n: n * n, range(20))) == [n * n for n in range(20)]
    assert list(ahead(str, ())) == []


def test_an_error_stands_where_its_result_would():
    results = ahead(lambda n: 6 / n, [3, 2, 0, 1])
    assert [next(results), next(results)] == [2.0, 3.0]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_work_runs_while_an_earlier_result_is_used():
    """The second piece ends while the first one is held, or this never does."""
    done = threading.Event()
    results = ahead(lambda n: done.set() if n else None, [0, 1])
    next(results)
    assert done.wait(60)
    results.close()


def test_who_stops_asking_stops_the_work_and_takes_no_more():
    taken = []
    begun = []

    def items():
        for n in range(100):
            taken.append(n)
            yield n

    results = ahead(begun.append, items())
    next(results)
    results.close()
    assert len(taken) == 2 and set(begun) <= set(taken)
