// Make scrolling parts reachable by keyboard, and name links that are pictures.
function reachable() {
  for (const each of document.querySelectorAll("pre, .table-wrapper, .math"))
    if (each.scrollWidth > each.clientWidth || each.scrollHeight > each.clientHeight) each.tabIndex = 0;
    else each.removeAttribute("tabindex");
}
addEventListener("DOMContentLoaded", () => {
  for (const link of document.querySelectorAll(".sphx-glr-thumbcontainer a"))
    link.setAttribute("aria-label", link.textContent.trim());
  reachable();
});
addEventListener("load", reachable);
addEventListener("resize", reachable);
