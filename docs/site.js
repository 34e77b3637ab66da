/* Tables that are wider than the page are put into boxes that scroll; the keyboard must reach these, too. */
function reach(root) {
  for (const box of root.querySelectorAll(".md-typeset__scrollwrap:not([tabindex])")) box.tabIndex = 0;
}

reach(document);
new MutationObserver(() => reach(document)).observe(document.body, { childList: true, subtree: true });
