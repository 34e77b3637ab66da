"""Access rules of workers and gateways, kept by a router: who may ask, and under which name who may answer."""

import json
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import zenoh
from api_fakes import vehicle
from certificates import Authority, needs_openssl
from loopback import free_endpoint
from test_service_silent_worker import Monitor
from worker_hall import Gateway, Reports, Said, until

from wingwatch.service.workers.answering import AnsweringPorts, WorkerAnswers
from wingwatch.service.workers.membership import Membership
from wingwatch.telemetry import LinkSecurity, ZenohSettings, access_rules, open_session
from wingwatch.telemetry.worker_keys import token_key, worker_key


@needs_openssl
def test_gateways_ask_workers_and_nobody_answers_in_another_s_name(tmp_path: Path) -> None:
    authority, endpoint = Authority(tmp_path), free_endpoint().replace("tcp/", "tls/")
    rules = tmp_path / "access.json5"
    rules.write_text(json.dumps(access_rules([("default", "uav1")], workers=["w1", "w2"], gateways=["g1"])))

    def shown(name: str) -> LinkSecurity:
        made = authority.sign(name)
        return LinkSecurity(authority.certificate, made.certificate, made.private_key)

    with ExitStack() as stack:

        def opened(name: str) -> zenoh.Session:
            settings = ZenohSettings.for_vehicle((endpoint,), shown(name))
            return stack.enter_context(open_session(settings))

        kept = replace(shown("router"), access=rules)
        stack.enter_context(open_session(ZenohSettings(mode="router", listen=(endpoint,), security=kept)))
        members: dict[str, Membership] = {}
        sessions = {name: opened(name) for name in ("w1", "w2", "default.uav1")}
        for who, name in (("w1", "w1"), ("w2", "w2-pod1")):
            ports = AnsweringPorts(Monitor(vehicle(name)), Reports(), Said(name))
            stack.enter_context(WorkerAnswers(sessions[who], name, ports))
            members[name] = stack.enter_context(Membership(sessions[who], name, 1.0, lambda: True))
            members[name].appear()
        tokens = [
            sessions[who].liveliness().declare_token(token_key(name, 1.0))
            for who, name in (("w1", "w3"), ("w1", "w2-pod2"), ("default.uav1", "w1-pod9"))
        ]
        forged = sessions["w1"].declare_queryable(
            worker_key("w2-pod1", "vehicle"), lambda query: query.reply(str(query.key_expr), b"forged")
        )
        gateway = Gateway(endpoint, security=shown("g1"))
        stack.callback(gateway.close)
        until(lambda: {view.vehicle for view in gateway.fleet.vehicles()} == {"w1", "w2-pod1"})
        assert set(gateway.fleet.states()) == {"w1", "w2-pod1"}
        view = gateway.fleet.vehicle("default", "w2-pod1")
        assert view is not None
        assert view.worker == "w2-pod1"
        forging = sessions["w1"], sessions["default.uav1"]

        def said() -> bool:  # what is declared takes a moment to be known
            for session in forging:
                session.put(worker_key("w2-pod1", "load"), "0.9")
            members["w2-pod1"].say_load(0.5)
            members["w1"].say_load(0.25)
            seen = members["w1"].workers()["w2-pod1"].load, members["w2-pod1"].workers()["w1"].load
            return seen == (0.5, 0.25)

        until(said)
        assert set(members["w2-pod1"].workers()) == {"w1", "w2-pod1"}
        question = worker_key("w1", "views")
        for who, answers in (("default.uav1", 0), ("w2", 1)):
            replies = list(sessions[who].get(question, timeout=2.0))
            assert sum(reply.ok is not None for reply in replies) == answers
        forged.undeclare()  # type: ignore[no-untyped-call]
        for token in tokens:
            token.undeclare()  # type: ignore[no-untyped-call]
