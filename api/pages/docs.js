/* REST as the service describes it itself, in Swagger UI from the installed package. Its version reads OpenAPI 3.0, and the
   description is 3.1: what differs between them is said in the older words here. */

/** A schema's part in the words of 3.0: null among alternatives is `nullable`, a constant an enumeration of one. */
function older(part) {
  if (Array.isArray(part)) return part.map(older);
  if (part === null || typeof part !== "object") return part;
  const made = Object.fromEntries(Object.entries(part).map(([name, value]) => [name, older(value)]));
  if (Array.isArray(made.anyOf)) withoutNull(made);
  if ("const" in made && typeof made.const !== "object") {
    made.enum = [made.const];
    delete made.const;
  }
  for (const [limit, side] of [["exclusiveMinimum", "minimum"], ["exclusiveMaximum", "maximum"]]) {
    if (typeof made[limit] !== "number") continue;
    made[side] = made[limit];
    made[limit] = true;
  }
  return made;
}

function withoutNull(made) {
  const others = made.anyOf.filter((one) => one.type !== "null");
  if (others.length === made.anyOf.length) return;
  made.nullable = true;
  delete made.anyOf;
  if (others.length > 1) made.anyOf = others;
  else if (others[0]?.$ref) made.allOf = others;
  else Object.assign(made, { ...others[0], ...made });
}

/** The names of operations as text: Swagger UI makes links of them inside of buttons, which screen readers and keys cannot
    tell apart. An operation that is opened still stands in the address. */
const plainNames = (system) => ({ components: { DeepLink: ({ text }) => system.React.createElement("span", null, text) } });

/** Names and the keyboard's focus, where Swagger UI gives none. */
function reach() {
  for (const box of place.querySelectorAll("pre:not([tabindex])")) box.tabIndex = 0;
  for (const choice of place.querySelectorAll("select:not([aria-label])")) {
    choice.setAttribute("aria-label", choice.closest("tr")?.querySelector(".parameter__name")?.textContent ?? "Media type");
  }
}

const place = document.getElementById("docs");
const answer = await fetch("/openapi.json", { cache: "no-store" });
if (answer.ok) {
  window.SwaggerUIBundle({
    spec: { ...older(await answer.json()), openapi: "3.0.3" },
    domNode: place,
    deepLinking: true,
    defaultModelsExpandDepth: 0,
    docExpansion: "list",
    validatorUrl: null,
    plugins: [plainNames],
    presets: [window.SwaggerUIBundle.presets.apis],
  });
  reach();
  new MutationObserver(reach).observe(place, { childList: true, subtree: true });
} else {
  place.textContent = answer.status === 401 ? "Log in on the page at / first; then load this one again." : `The service answered ${answer.status}.`;
}
