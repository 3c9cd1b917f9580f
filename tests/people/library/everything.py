"""A script that uses the whole public interface, for mypy and pyright, which are to be content.

It is checked, in strict mode, and not run: ``test_face.py`` holds that no name is missing.
"""

from pathlib import Path

import scenario_tui as st
from scenario_tui.errors import Refused, TraceUnavailable


def prepare(path: Path) -> st.Campaign:
    findings: list[st.Finding] = st.check(path)
    for finding in findings:
        print(finding.where.file, finding.where.line, finding.message, finding.hint)
    campaign = st.load(path)
    print(campaign.name, campaign.about, campaign.path, campaign.runs)
    print(", ".join(campaign.scenarios), ", ".join(campaign.systems), ", ".join(campaign.searches))
    assert not campaign.check()
    scene: st.Scene = campaign.scene("busy-house")
    Path("scene.svg").write_text(scene.picture(), encoding="utf-8")
    print(scene.scenario, scene.spaces, scene.objects)
    return campaign.select("busy-house", system="my-nav2.yaml")


def judge(results: st.Results) -> None:
    print(results.id, results.name, results.finished)
    assert results.passed, "\n".join(results.unexpected)
    cell: st.Cell = results["busy-house", "pilot"]
    verdict: st.Verdict = cell["keeps-clear"]
    if verdict.outcome is st.Outcome.PASS and verdict.margin is not None:
        print(f"{verdict.margin + 0.0:.2f} {verdict.unit} {verdict.moment} {verdict.about}")
    for cell in results.cells:
        print(cell.scenario, cell.system, cell.outcome.value, len(cell.runs), len(cell.verdicts))


def look(run: st.Run) -> float:
    print(run.id, run.scenario, run.system, run.repeat, run.seed, run.note, run.replay_command)
    print(run.outcome.value if run.outcome is not None else "lost", len(run.verdicts))
    trace: st.Trace = run.trace
    clearance: st.Signal = trace.signal("clearance")
    print(clearance.name, clearance.unit, clearance.time.shape)
    print(trace.judge("always(clearance >= 0.1 m)").margin, len(trace.verdicts))
    Path("run.svg").write_text(run.picture() or trace.picture(), encoding="utf-8")
    return float(clearance.value.min())


def main() -> None:
    try:
        judge(st.run("campaign.yaml"))
        results = prepare(Path("campaign.yaml")).run(workers=2, out="traces")
        least = min(look(run) for run in results.runs)
        print(least, results.to_arrow(), results.to_pandas())
        job: st.Job = st.submit("campaign.yaml", connect="tls/lab:7447")
        print(job.id, st.load("campaign.yaml").submit(fresh=True).cancel())
        for run in job.results():
            print(run.id)
        judge(job.wait(timeout=60.0))
        judge(st.results("demo", state="/var/lib/scenario"))
    except st.InputError as error:
        print(*error.findings, sep="\n")
    except (Refused, TraceUnavailable) as error:
        print(error)
    except st.DaemonError as error:
        raise SystemExit(str(error)) from error
    except st.ScenarioError:
        raise


if __name__ == "__main__":
    main()
