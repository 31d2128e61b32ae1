// Before anything else of the page: of its address only the values of controls stay. The token goes,
// and so does what trame would take from there, such as another server to talk to. Then the page
// waits for its turn, and says why.
(() => {
  const OFTEN = 1000; // ms
  const LOST = "skinwave does not respond; this page opens as soon as it does.";
  const { main, keys } = document.currentScript.dataset, address = new URL(window.location);
  const kept = keys.split(" ");
  const taken = [...address.searchParams.keys()].filter((key) => !kept.includes(key));
  if (taken.length) {
    taken.forEach((key) => address.searchParams.delete(key));
    window.history.replaceState({}, document.title, address);
  }
  const page = crypto.randomUUID();
  document.documentElement.dataset.sessionManagerUrl =
    new URL(`paraview/?page=${page}`, document.baseURI).href;

  async function why() {
    try {
      const response = await fetch(`turn?page=${page}`, { cache: "no-store" });
      return response.ok ? (await response.json()).wait : await response.text();
    } catch {
      return LOST;
    }
  }

  async function turn() {
    const said = await why();
    document.getElementById("sw-waiting").textContent = said;
    if (said) {
      setTimeout(turn, OFTEN);
      return;
    }
    const script = document.createElement("script");
    [script.type, script.src] = ["module", main];
    document.head.appendChild(script);
  }

  turn();
})();
