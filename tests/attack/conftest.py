import tempfile

import pytest


@pytest.fixture(autouse=True, scope="session")
def lock_files_of_their_own(tmp_path_factory):
    """Robots lock their names in the temporary folder; those of the tests are not to pile up there."""
    with pytest.MonkeyPatch.context() as patch:
        folder = str(tmp_path_factory.mktemp("locks"))
        patch.setenv("TMPDIR", folder)
        patch.setattr(tempfile, "tempdir", folder)
        yield
