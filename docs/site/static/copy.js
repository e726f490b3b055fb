// A button on each block of code, which copies it. Also for pages that are files, where browsers give no
// clipboard.
function copied(text) {
  if (navigator.clipboard && window.isSecureContext) {
    return navigator.clipboard.writeText(text).then(() => true, () => byHand(text));
  }
  return Promise.resolve(byHand(text));
}

function byHand(text) {
  const area = document.createElement("textarea");
  area.value = text;
  area.style.position = "fixed"; // scrolls nowhere
  document.body.append(area);
  area.select();
  const done = document.execCommand("copy");
  area.remove();
  return done;
}

document.addEventListener("DOMContentLoaded", () => {
  for (const pre of document.querySelectorAll("article div.highlight > pre")) {
    const button = document.createElement("button");
    button.className = "copy";
    button.type = "button";
    button.textContent = "Copy";
    button.title = "Copy this block";
    button.addEventListener("click", async () => {
      button.textContent = (await copied(pre.textContent)) ? "Copied" : "Select it, and press Ctrl-C";
      setTimeout(() => (button.textContent = "Copy"), 2000);
    });
    pre.parentElement.append(button);
  }
});
