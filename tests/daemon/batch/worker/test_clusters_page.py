"""The recipes of docs/clusters.md: executed where this machine can, read by who reads them else."""

import configparser
import os
import re
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from daemon.batch.amounts import parse_size
from tests.daemon.batch.harness import (
    DEADLINE,
    EXECUTOR,
    ROOT,
    Part,
    daemon_at,
    end,
    eventually,
    family,
    finished,
    free_endpoint,
)
from tests.daemon.batch.samples import make_submission

PAGE = (ROOT / "docs" / "clusters.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
SHELL = [(kind, text) for kind, text in BLOCKS if kind in ("sh", "bash", "console")]
SPEC = "metadata.name spec.replicas spec.strategy.type spec.selector.matchLabels.*"
TEMPLATE = "spec.template.metadata.labels.* spec.template.spec"
FIELDS = {
    "Deployment": ("apps/v1", f"{SPEC} {TEMPLATE}.automountServiceAccountToken "
        f"{TEMPLATE.split()[1]}.restartPolicy {TEMPLATE.split()[1]}.containers.* "
        f"{TEMPLATE.split()[1]}.volumes.*"),
    "Service": ("v1", "metadata.name spec.selector.* spec.ports.*"),
    "NetworkPolicy": ("networking.k8s.io/v1", "metadata.name spec.podSelector.matchLabels.* "
        "spec.policyTypes spec.ingress.from.podSelector.matchLabels.* spec.ingress.ports.* "
        "spec.ingress.from.podSelector.matchExpressions.* "
        "spec.egress.to.podSelector.matchLabels.* spec.egress.ports.* "
        "spec.egress.to.namespaceSelector.matchLabels.*"),
}  # fmt: skip
"""Fields of the API that the page may use (Kubernetes 1.31); ``*``: whatever follows."""
CONTAINER = {
    "name", "image", "args", "ports", "readinessProbe", "resources", "volumeMounts",
}  # fmt: skip
PORT = {"name", "containerPort", "port", "targetPort", "protocol", "endPort"}
DASK_TLS = "DASK_DISTRIBUTED__COMM__TLS"
CA = ("--tls-ca-file", "ca.pem")


def script(name):
    """The block whose first line says that it is that file."""
    (text,) = (text for _, text in BLOCKS if text.startswith(f"# {name}"))
    return str(text)


@pytest.mark.parametrize(
    ("kind", "text"), SHELL, ids=[text.split("\n")[0][:40] for _, text in SHELL]
)
def test_shell_is_shell(kind, text):
    if kind == "console":
        text = re.sub(r"^\$ ", "", text, flags=re.MULTILINE)
    command = ["sh" if kind == "sh" else "bash", "-n"]
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_python_compiles_and_units_are_read():
    for kind, text in BLOCKS:
        if kind == "python":
            compile(text, "clusters.md", "exec")
    (unit,) = (text for kind, text in BLOCKS if kind == "ini")
    read = configparser.ConfigParser(interpolation=None)
    read.optionxform = str
    read.read_string(unit)
    assert read["Service"]["Restart"] == "always"


def objects():
    (text,) = (text for kind, text in BLOCKS if kind == "yaml")
    return list(YAML(typ="safe").load_all(text))


def paths(value, at=""):
    """Where the leaves of an object are; items of a list lie where the list does."""
    if isinstance(value, dict) and value:
        for key, item in value.items():
            yield from paths(item, f"{at}.{key}".lstrip("."))
    elif isinstance(value, list):
        for item in value:
            yield from paths(item, at)
    else:
        yield at


def test_the_objects_of_kubernetes_have_fields_of_its_api():
    found = objects()
    assert [one["kind"] for one in found] == [
        "Deployment", "Service", "Deployment", "NetworkPolicy", "NetworkPolicy",
    ]  # fmt: skip
    for one in found:
        version, known = FIELDS[one["kind"]]
        assert one["apiVersion"] == version
        allowed = {"apiVersion", "kind", *known.split()}
        for path in paths(one):
            parts = path.split(".")
            stems = {".".join([*parts[:i], "*"]) for i in range(len(parts))}
            assert path in allowed or stems & allowed, path
        if one["kind"] == "Deployment":
            pod = one["spec"]["template"]
            assert pod["metadata"]["labels"] == one["spec"]["selector"]["matchLabels"]
            # A scheduler's end makes its workers end with 0: only this starts them again.
            assert pod["spec"]["restartPolicy"] == "Always"
            (container,) = pod["spec"]["containers"]
            assert set(container) <= CONTAINER
            assert all(isinstance(word, str) for word in container["args"])
            assert set().union(*container.get("ports", [{}])) <= PORT
            mounted = {mount["name"] for mount in container["volumeMounts"]}
            assert mounted == {volume["name"] for volume in pod["spec"]["volumes"]}


def test_policies_let_through_the_ports_that_are_used():
    found = {(one["kind"], one["metadata"]["name"]): one["spec"] for one in objects()}
    labels = {name for kind, name in found if kind == "Deployment"}
    args = found["Deployment", "dask-worker"]["template"]["spec"]["containers"][0]["args"]
    used = [int(args[args.index(name) + 1]) for name in ("--worker-port", "--nanny-port")]
    (service,) = found["Service", "dask-scheduler"]["ports"]
    for name in labels:
        policy = found["NetworkPolicy", name]
        assert policy["podSelector"]["matchLabels"] == {"app": name}
        assert policy["policyTypes"] == ["Ingress", "Egress"]
        (port,) = policy["ingress"][0]["ports"]
        open_ports = list(range(port["port"], port.get("endPort", port["port"]) + 1))
        assert open_ports == ([service["port"]] if name == "dask-scheduler" else used)


def test_figures_of_memory_add_up():
    found = next(one for one in objects() if one["metadata"]["name"] == "dask-worker")
    (container,) = found["spec"]["template"]["spec"]["containers"]
    threads = int(container["args"][container["args"].index("--nthreads") + 1])
    (memory,) = set(re.findall(r"--memory (\S+iB)", PAGE))
    most = 350e6 + threads * (parse_size(memory) + 256 * 2**20)
    assert most <= parse_size(container["resources"]["limits"]["memory"] + "B")
    job = int(re.findall(r"--mem=(\d+)G", PAGE)[0])
    cores = int(re.findall(r"--cpus-per-task=(\d+)", PAGE)[0])
    assert 350e6 + cores * (parse_size(memory) + 256 * 2**20) <= job * 2**30


@contextmanager
def program(folder, *command):
    """A program of the page with its certificates; nothing of it is left afterwards."""
    with (folder / f"{Path(command[0]).name}.log").open("ab") as log:
        process = subprocess.Popen(
            command, cwd=folder, stdout=log, stderr=log, start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(ROOT), "PAUSE": "0.1",
                 "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"},
        )  # fmt: skip
    try:
        yield process
    finally:
        if process.poll() is None:
            end(family(process.pid))
        process.wait(DEADLINE)


def tls(name):
    return (*CA, "--tls-cert", f"{name}.pem", "--tls-key", f"{name}.key")


@pytest.mark.skipif(shutil.which("openssl") is None, reason="there is no openssl")
def test_workers_of_the_recipe_come_back_when_their_scheduler_does(tmp_path, monkeypatch):
    names = ("certificates.sh", "keep-going.sh")
    for name in names:
        (tmp_path / name).write_text(script(name))
    make = ["sh", "certificates.sh", str(tmp_path), "scheduler", "worker-1"]
    subprocess.run(make, cwd=tmp_path, check=True, capture_output=True)
    # Another time, for one more: the authority stays.
    subprocess.run([*make[:3], "gateway"], cwd=tmp_path, check=True, capture_output=True)
    port = free_endpoint().rpartition(":")[2]
    address = f"tls://127.0.0.1:{port}"
    dask = str(Path(sys.executable).with_name("dask"))
    quiet = ("--dashboard-address", "127.0.0.1:0")
    scheduler = (dask, "scheduler", "--host", "tls://127.0.0.1", "--port", port, *quiet)
    worker = ("sh", "keep-going.sh", dask, "worker", address, "--nthreads", "2", "--no-nanny")
    gate = tmp_path / "gate"
    with (
        daemon_at(tmp_path / "state") as daemon,
        daemon.client() as client,
        program(tmp_path, *scheduler, *tls("scheduler")) as first,
        program(
            tmp_path, *worker, *quiet, "--local-directory", "scratch", *tls("worker-1")
        ) as kept,
    ):
        # `scenario worker` has options for these, but none for the executor of a test.
        for key, name in (("CA_FILE", "ca"), ("CLIENT__CERT", "gateway")):
            monkeypatch.setenv(f"{DASK_TLS}__{key}", str(tmp_path / f"{name}.pem"))
        monkeypatch.setenv(f"{DASK_TLS}__CLIENT__KEY", str(tmp_path / "gateway.key"))
        where = ("--connect", daemon.endpoint, "--scheduler", address, "--executor", EXECUTOR)
        eventually(lambda: "Scheduler at" in (tmp_path / "dask.log").read_text())
        gateway = Part("worker", tmp_path / "gateway.log", *where)
        try:
            eventually(lambda: [row.slots for row in client.workers()] == [2])
            client.submit(make_submission("c", 4, until=str(gate)))
            eventually(lambda: client.overview().running >= 2)
            first.send_signal(signal.SIGKILL)
            eventually(lambda: "ended with 0, again" in (tmp_path / "sh.log").read_text())
            gate.touch()
            with program(tmp_path, *scheduler, *tls("scheduler")):
                eventually(lambda: finished(client, 4))
                rows = client.runs("c").rows
                assert {row.state for row in rows} == {"done"}
                assert max(row.attempt for row in rows) > 1
                kept.send_signal(signal.SIGTERM)
                assert kept.wait(DEADLINE) == 0
        finally:
            gateway.kill()
