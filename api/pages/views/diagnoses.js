import { make } from "../dom.js";

export function view() {
  return { node: make("div", "", make("h1", "", "Diagnoses")), update() {}, close() {} };
}
