// The page before the studio's: takes the password, and goes to the address that it opens.

import { texts } from "./texts.js";

const byId = (id) => document.getElementById(id);

function fault(sentence) {
  byId("fault").textContent = sentence;
  byId("fault").hidden = !sentence;
}

byId("enter-form").addEventListener("submit", async (event) => {
  event.preventDefault();
  fault("");
  byId("enter").disabled = true;
  try {
    const answer = await fetch("enter", {
      method: "POST", body: JSON.stringify({ password: byId("password").value }),
    });
    const said = await answer.json();
    if (answer.ok) location.replace(said.address);
    else fault(said.error);
  } catch {
    fault(texts.frame.no_answer);
  }
  byId("enter").disabled = false;
  byId("password").select();
});
document.documentElement.dataset.ready = "yes";
