/* Finished studies: what each found, and its report. */

import { NotLoggedIn, Refused, failure, get } from "../api.js";
import { make, setText, sync } from "../dom.js";

export function view() {
  const list = make("ol", "jobs", { id: "studies" });
  const none = make("p", "quiet", { hidden: true }), problem = make("p", "problem", { role: "alert" });
  const node = make("div", "", make("h1", "", "Studies"),
    make("p", "lead", "How good the monitor's decisions are, in thousands of simulated flights."), problem, none, list);
  let open = true;

  async function ask() {
    try {
      const { items } = await get("/v1/studies");
      if (!open) return;
      sync(list, items, (study) => study.name, studyItem);
      none.hidden = items.length > 0;
      setText(none, "The folder of studies has no report yet; wingwatch study with --report writes one.");
    } catch (error) {
      if (!open || error instanceof NotLoggedIn) return;
      if (error instanceof Refused && error.status === 404) {
        none.hidden = false;
        setText(none, error.message);
      } else {
        problem.textContent = failure(error);
      }
    }
  }
  ask();

  return { node, update() {}, close: () => { open = false; } };
}

function studyItem(study) {
  const written = new Date(1000 * study.written_at_s);
  return make("li", "card", make("div", "head", make("h3", "", study.name), make("span", "soft", written.toLocaleDateString())),
    make("p", "", study.answer || study.title), study.answer ? make("p", "soft", study.title) : null,
    make("div", "acts", make("a", "button", { href: study.report, target: "_blank", rel: "noopener" }, "Open the report")));
}
