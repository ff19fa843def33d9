// XML in colours: each line as spans of text, never as markup.
import { make } from "./dom.js";

const TOKEN = /<!--.*?(?:-->|$)|<[/?]?[\w:.-]+|[\w:.-]+(?=\s*=\s*["'])|"[^"]*"|'[^']*'|\{[^}]*\}|[/?]?>|[^<>"'{}\s=]+|./g;

// Returns a line of XML; `state` says whether it begins within a comment or a tag.
export function codeLine(line, state) {
  const made = make("code");
  let rest = line;
  if (state.isComment) {
    const end = rest.indexOf("-->");
    const until = end < 0 ? rest.length : end + 3;
    made.append(make("span", { class: "x-comment", text: rest.slice(0, until) }));
    state.isComment = end < 0;
    rest = rest.slice(until);
  }
  for (const [token] of rest.matchAll(TOKEN)) {
    let kind = null;
    if (token.startsWith("<!--")) {
      kind = "x-comment";
      state.isComment = !token.endsWith("-->");
    } else if (/^<[/?]?\w/.test(token)) {
      kind = "x-tag";
      state.isTag = true;
    } else if (/^[/?]?>$/.test(token)) {
      kind = "x-tag";
      state.isTag = false;
    } else if (token.startsWith("{")) kind = "x-braces";
    else if (state.isTag) kind = /^["']/.test(token) ? "x-value" : "x-name";
    made.append(kind ? make("span", { class: kind, text: token }) : token);
  }
  return made;
}
