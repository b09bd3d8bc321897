// The smallest of tools: elements, requests to our own server, the clipboard.

import { texts } from "./texts.js";

export const byId = (id) => document.getElementById(id);

export function element(tag, properties = {}, ...children) {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
}

/** `text` with the values of its {names}. */
export const say = (text, values) => text.replace(/\{(\w+)\}/g, (_, name) => values[name]);

const KEY = location.pathname.split("/")[1];

/** What the server answers; what it refuses is thrown with its sentence. */
export async function ask(route, body, headers = {}) {
  const how = body === undefined ? {} : {
    method: "POST",
    headers: { "X-Studio-Key": KEY, ...headers },
    body: body instanceof Blob ? body : JSON.stringify(body),
  };
  let answer;
  try {
    answer = await fetch(route, how);
  } catch {
    throw new Error(texts.frame.no_answer);
  }
  const said = await answer.json();
  if (!answer.ok) throw new Error(said.error);
  return said;
}

export async function copy(button) {
  const code = byId(button.dataset.copy);
  try {
    await navigator.clipboard.writeText(code.textContent);
    button.textContent = texts.words.copied;
    setTimeout(() => { button.textContent = texts.words.copy; }, 1500);
  } catch {
    getSelection().selectAllChildren(code);
  }
}

export const hasWebGl = document.createElement("canvas").getContext("webgl2") !== null;
