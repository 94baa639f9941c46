// The OpenAPI document as a page: nothing is fetched from elsewhere.

import { byId, el } from "./dom.js";
import "./theme.js";

const answer = await fetch("/api/openapi.json");
const spec = await answer.json();
const parts = [el("h1", { text: `${spec.info.title} HTTP API` }), el("p", { text: spec.info.description })];
parts.push(el("p", {}, el("a", { href: "/api/openapi.json", text: "openapi.json" })));
for (const [path, methods] of Object.entries(spec.paths)) {
  for (const [method, act] of Object.entries(methods)) {
    const output = el("pre", { hidden: true });
    const button = el("button", { class: "act", text: "Try" });
    button.onclick = async () => {
      const tried = await fetch(path);
      output.hidden = false;
      output.textContent = `${tried.status}\n${JSON.stringify(await tried.json(), null, 1).slice(0, 20000)}`;
    };
    parts.push(el("h2", { text: `${method.toUpperCase()} ${path}` }), el("p", { text: act.summary }), button, output);
  }
}
parts.push(el("h2", { text: "Schemas" }));
for (const [name, schema] of Object.entries(spec.components?.schemas ?? {})) {
  parts.push(el("h3", { text: name }), el("p", { text: schema.description ?? "" }));
  parts.push(el("pre", { text: JSON.stringify(schema.properties ?? {}, null, 1) }));
}
byId("docs").replaceChildren(...parts);
