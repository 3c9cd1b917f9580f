"""Zygotes that compile kernels, which takes long: once, and not for ever."""

from contextlib import closing
from dataclasses import replace

from daemon.batch.worker._zygotes import ZygotePool
from daemon.model.spec import SutReference
from tests.batch.parts.test_zygotes import SHORT, prepare, run, scene, zygote_of_mine
from tests.make import make_spec

__all__ = ["scene"]


def test_a_worker_compiles_once_and_says_how_far_it_is(tmp_path, scene, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    spec = replace(make_spec(), sut=SutReference("idle", "idle", {}), limit=0.5)
    counts = []
    for number in range(2):
        with closing(ZygotePool(1)) as pool:
            seen = [0]
            prepare(
                pool,
                spec,
                scene,
                lambda p=pool, s=seen: s.append(p.preparation.done if p.preparation else 0),
            )
            counts.append(max(seen))
            attempt, why = run(pool, tmp_path / f"{number}", spec, scene)
            assert attempt.finished, why
    compiled = len(list((tmp_path / "kernels").rglob("*.nbi")))
    assert counts[0] > 1
    assert counts[1] == 0
    assert len(list((tmp_path / "kernels").rglob("*.nbc"))) == compiled


def test_a_short_run_that_is_killed_leaves_compiling_to_the_run(tmp_path, scene, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    with closing(ZygotePool(1)) as pool:
        killed = []

        def kill_once():
            if pool.preparation and not killed:
                killed.extend(zygote_of_mine().children())
                for child in killed:
                    child.kill()

        prepare(pool, SHORT, scene, kill_once)
        assert killed
        attempt, why = run(pool, tmp_path / "run", SHORT, scene)
        assert attempt.finished, why
