/* What a person does to an alert: acknowledge, shelve, unshelve, clear. A button with `data-act` in a part with
   `data-alert` is enough; what was done is seen by every open page, for the service tells of it. */

import { actOnAlert, failure } from "./api.js";
import { make, setText } from "./dom.js";
import { sentence, vehicleName, words } from "./format.js";
import { keep, kept } from "./settings.js";
import { announce, notice } from "./shell.js";

const MINUTES = [[15, "15 minutes"], [60, "1 hour"], [240, "4 hours"], [480, "8 hours"], [1440, "24 hours"]];
const DONE = { acknowledge: "Acknowledged", shelve: "Shelved", unshelve: "Back from the shelf", clear: "Cleared" };
const ALLOWED = {
  active: ["acknowledge", "shelve", "clear"], acknowledged: ["shelve", "clear"], shelved: ["unshelve", "clear"], cleared: [],
};

/** What may be done to an alert as it stands. */
export function allowed(alert) {
  return ALLOWED[alert.state] ?? [];
}

/** The buttons of an alert; none for who may only read. */
export function actButtons(alert, session) {
  const actions = session.scope === "read" ? [] : allowed(alert);
  if (!actions.length) return [];
  return [make("div", "acts", ...actions.map((action) =>
    make("button", action === "acknowledge" ? "main" : "", { type: "button", data: { act: action } },
      sentence(action) + (["shelve", "clear"].includes(action) ? "…" : ""))))];
}

/** Whose name an action is kept under where there is no token. */
const ownName = () => kept("name", "");

export class Acting {
  /** `session()`: who looks; `store`: asked again after an action. */
  constructor(store, session) {
    this.store = store;
    this.session = session;
    this.#makeDialog();
    document.addEventListener("click", (event) => {
      const button = event.target.closest?.("[data-act]"), id = button?.closest("[data-alert]")?.dataset.alert;
      if (id) this.start(id, button.dataset.act);
    });
  }

  /** Begin an action: at once where nothing has to be asked, else with a dialog. */
  start(id, action) {
    const alert = this.store.state.status?.alerts.find((one) => one.id === id);
    if (!alert) return;
    if (!allowed(alert).includes(action)) {
      notice(`${sentence(alert.cause)} on ${vehicleName(alert)} is ${alert.state}; ${action} does not apply.`);
      return;
    }
    const named = this.session().name !== null || ownName();
    if (named && ["acknowledge", "unshelve"].includes(action)) this.#do(alert, action, {}, notice);
    else this.#ask(alert, action);
  }

  #makeDialog() {
    this.title = make("h2", "", { id: "act-title" });
    this.about = make("p", "soft");
    this.who = make("input", "", { id: "act-who", maxlength: 100, autocomplete: "name", required: true });
    this.whoField = field("act-who", "Your name", this.who);
    this.minutes = make("select", "", { id: "act-minutes" }, ...MINUTES.map(([value, text]) => make("option", "", { value, selected: value === 60 }, text)));
    this.minutesField = field("act-minutes", "For", this.minutes);
    this.note = make("textarea", "", { id: "act-note", maxlength: 1000, rows: 2 });
    this.problem = make("p", "problem", { role: "alert" });
    this.confirm = make("button", "main", { type: "submit" });
    this.form = make("form", "", this.title, this.about, this.whoField, this.minutesField, field("act-note", "Note", this.note), this.problem,
      make("div", "acts", this.confirm, make("button", "", { type: "button", onclick: () => this.dialog.close() }, "Cancel")));
    this.dialog = make("dialog", "card", { "aria-labelledby": "act-title" }, this.form);
    this.form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#confirmed();
    });
    document.body.append(this.dialog);
  }

  #ask(alert, action) {
    this.asked = { alert, action };
    setText(this.title, `${sentence(action)}: ${words(alert.cause)} on ${vehicleName(alert)}`);
    setText(this.about, alert.text);
    this.whoField.hidden = this.session().name !== null;
    this.who.required = !this.whoField.hidden;
    this.who.value = ownName();
    this.minutesField.hidden = action !== "shelve";
    this.note.required = action === "clear";
    this.note.value = "";
    this.problem.textContent = "";
    setText(this.confirm, sentence(action));
    this.dialog.showModal();
    (this.whoField.hidden || this.who.value ? (action === "shelve" ? this.minutes : this.note) : this.who).focus();
  }

  async #confirmed() {
    const { alert, action } = this.asked;
    const body = { note: this.note.value.replace(/\s+/g, " ").trim() };
    if (action === "shelve") body.minutes = Number(this.minutes.value);
    if (!this.whoField.hidden) keep("name", this.who.value.trim());
    this.confirm.disabled = true;
    await this.#do(alert, action, body, (sentenceOfIt) => { this.problem.textContent = sentenceOfIt; });
    this.confirm.disabled = false;
  }

  async #do(alert, action, body, refused) {
    const who = this.session().name === null ? { who: ownName() } : {};
    try {
      await actOnAlert(alert.id, action, { ...body, ...who });
      if (this.dialog.open) this.dialog.close();
      announce(`${DONE[action]}: ${words(alert.cause)} on ${vehicleName(alert)}.`);
      this.store.refresh();
    } catch (error) {
      refused(failure(error));
    }
  }
}

function field(id, label, input) {
  return make("p", "field", make("label", "", { for: id }, label), input);
}
