import pytest


@pytest.fixture
def robot(folder):
    from keyed_bed import serving  # not sooner: a run without these tests loads this file, too

    with serving(folder) as served:
        yield served
