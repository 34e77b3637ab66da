"""Asks a wingwatch service over REST, with Python alone: vehicles, alerts, derivatives; acknowledges; follows events.

    python examples/rest_client.py [http://127.0.0.1:8000] [--acknowledge ALERT] [--events N]

Where the service asks for a token, it is read from WINGWATCH_TOKEN.
"""

import argparse
import json
import os
from collections.abc import Iterator
from typing import Any
from urllib.error import HTTPError
from urllib.request import Request, urlopen


def ask(url: str, body: dict[str, Any] | None = None) -> Any:
    """The JSON that a path answers; a problem document ends the program with its sentence."""
    headers = {"Content-Type": "application/json"} if body is not None else {}
    if token := os.environ.get("WINGWATCH_TOKEN"):
        headers["Authorization"] = f"Bearer {token}"
    data = None if body is None else json.dumps(body).encode()
    try:
        with urlopen(Request(url, data, headers), timeout=10.0) as answer:
            return json.load(answer)
    except HTTPError as problem:
        raise SystemExit(json.load(problem)["detail"]) from None


def events(url: str) -> Iterator[tuple[str, Any]]:
    """Kind and data of each event of the stream, as they come."""
    kind = ""
    with urlopen(Request(f"{url}/v1/events"), timeout=60.0) as stream:
        for raw in stream:
            name, _, value = raw.decode().rstrip("\n").partition(": ")
            if name == "event":
                kind = value
            elif name == "data":
                yield kind, json.loads(value)


def main() -> None:
    """Print what the service knows."""
    parser = argparse.ArgumentParser()
    parser.add_argument("url", nargs="?", default="http://127.0.0.1:8000")
    parser.add_argument("--acknowledge", metavar="ALERT")
    parser.add_argument("--events", type=int, default=0, metavar="N")
    chosen = parser.parse_args()
    for vehicle in ask(f"{chosen.url}/v1/vehicles")["items"]:
        print(f"{vehicle['fleet']}/{vehicle['vehicle']}: {vehicle['state']}; {vehicle['reason']}")
        found = ask(f"{chosen.url}/v1/vehicles/{vehicle['vehicle']}/derivatives?fleet={vehicle['fleet']}")
        for estimator, modes in found["estimators"].items():
            for mode in modes.values():
                for symbol, one in mode.get("derivatives", {}).items():
                    if one["outcome"] == "converged":
                        print(
                            f"  {estimator:8}{symbol:8}{one['value']:10.4g} ± {one['standard_error']:.2g} {one['unit']}"
                        )
    for alert in ask(f"{chosen.url}/v1/alerts?state=active")["items"]:
        print(f"{alert['id']} {alert['level']}: {alert['text']}")
    if chosen.acknowledge:
        done = ask(
            f"{chosen.url}/v1/alerts/{chosen.acknowledge}/acknowledge", {"who": "rest_client", "note": "seen"}
        )
        print(f"{done['id']} is {done['state']}")
    for _, (kind, data) in zip(range(chosen.events), events(chosen.url), strict=False):
        print(kind, data)


if __name__ == "__main__":
    main()
