"""What several tests of this folder use."""

from collections.abc import Iterator

import pytest

from tests.kit.processes import Stand, stand


@pytest.fixture(scope="module")
def there(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Stand]:
    with stand(tmp_path_factory.mktemp("stand")) as running:
        yield running
