// Plays the motion of an example above its page; without this script a click leads to the player.
document.addEventListener("click", (event) => {
  const link = event.target.closest("a.play");
  if (!link || event.ctrlKey || event.metaKey || event.shiftKey || event.button !== 0) return;
  event.preventDefault();
  const dialog = document.createElement("dialog");
  dialog.className = "player";
  const frame = document.createElement("iframe");
  frame.src = link.href;
  frame.title = link.title;
  const close = document.createElement("button");
  close.textContent = "\u00d7";
  close.title = "Close (Esc)";
  close.addEventListener("click", () => dialog.close());
  dialog.addEventListener("click", ({ target }) => target === dialog && dialog.close());
  dialog.addEventListener("close", () => dialog.remove());
  dialog.append(frame, close);
  document.body.append(dialog);
  dialog.showModal();
});
