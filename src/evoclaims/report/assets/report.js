// Evidence is unpacked where it is asked for. Filters are kept in the address after "#?", so that a view can be shared.
(() => {
  "use strict";
  const within = (element, selector) => [...element.querySelectorAll(selector)];

  // Pieces of the page by name: JSON, compressed, in base64.
  let pieces = null;
  const unpacking = (async () => {
    const text = atob(document.getElementById("pieces").content.textContent);
    const bytes = Uint8Array.from(text, (letter) => letter.charCodeAt(0));
    const plain = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    pieces = await new Response(plain).json();
  })();
  unpacking.catch(() => {
    document.getElementById("unpackable").hidden = false;
  });

  // Puts the pieces that belong to an open element in their places; those in closed ones wait.
  const fill = (details) => {
    if (!pieces) return;
    for (const place of within(details, "[data-piece]")) {
      if (place.closest("details") !== details) continue;
      place.innerHTML = pieces[place.dataset.piece];
      place.removeAttribute("data-piece");
    }
  };
  const open = (details) => {
    details.open = true;
    fill(details);
  };
  document.addEventListener("toggle", (event) => event.target.open && unpacking.then(() => fill(event.target)), true);

  // A link to a claim or to a part of the page opens what it is in, and a claim's evidence.
  const target = () => {
    const found = location.hash.startsWith("#?") ? null : document.getElementById(location.hash.slice(1));
    if (!found) return null;
    for (let around = found.closest("details"); around; around = around.parentElement.closest("details")) open(around);
    found.querySelectorAll(":scope > details.evidence").forEach(open);
    return found;
  };

  addEventListener("beforeprint", () => {
    // paper has no clicks
    for (const details of within(document, "details.entry, details.chapter, details.evidence")) open(details);
  });

  const form = document.getElementById("filters");
  if (!form) return; // a page without claims
  const names = ["verdict", "tier", "section", "method", "words"];
  const nothing = document.getElementById("nothing");
  const shown = document.getElementById("shown");
  const claims = within(document, "section.claim").map((element) => ({
    element,
    verdict: element.dataset.verdict,
    tier: element.dataset.tier,
    sections: JSON.parse(element.dataset.places),
    methods: JSON.parse(element.dataset.methods),
    text: within(element, "h3, blockquote, .judged, .reason, .because, .where")
      .map((part) => part.textContent)
      .join(" ")
      .toLowerCase(),
  }));
  const chips = new Map(within(document, "[data-for]").map((chip) => [chip.dataset.for, chip]));

  const chosen = () => {
    const query = new URLSearchParams();
    for (const [name, value] of new FormData(form)) if (value.trim()) query.append(name, value.trim());
    return query;
  };

  const apply = () => {
    const query = chosen();
    const verdicts = query.getAll("verdict");
    const tiers = query.getAll("tier");
    const words = (query.get("words") || "").toLowerCase().split(/\s+/).filter(Boolean);
    let count = 0;
    for (const claim of claims) {
      const kept =
        (!verdicts.length || verdicts.includes(claim.verdict)) &&
        (!tiers.length || tiers.includes(claim.tier)) &&
        (!query.has("section") || claim.sections.includes(query.get("section"))) &&
        (!query.has("method") || claim.methods.includes(query.get("method"))) &&
        words.every((word) => claim.text.includes(word));
      claim.element.hidden = !kept;
      chips.get(claim.element.id)?.classList.toggle("faint", !kept);
      count += kept;
    }
    for (const line of within(document, "details.entry")) line.hidden = !line.querySelector("section.claim:not([hidden])");
    nothing.hidden = count > 0;
    shown.textContent = `${count} of ${claims.length} claims`;
  };

  const set = (query) => {
    for (const field of form.elements) {
      if (!names.includes(field.name)) continue;
      if (field.type === "checkbox") field.checked = query.getAll(field.name).includes(field.value);
      else field.value = query.get(field.name) || "";
    }
    apply();
  };

  const follow = () => {
    form.closest("details").open ||= location.hash.startsWith("#?");
    if (location.hash.startsWith("#?")) return set(new URLSearchParams(location.hash.slice(2)));
    const found = target();
    if (found?.hidden || found?.closest("[hidden]")) set(new URLSearchParams()); // a link shows it, whatever the filters say
    found?.scrollIntoView();
    return undefined;
  };

  const change = () => {
    apply();
    const query = chosen().toString();
    history.replaceState(null, "", query ? `#?${query}` : "#");
  };

  form.hidden = false;
  form.addEventListener("input", change);
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("reset", () => setTimeout(change));
  addEventListener("hashchange", follow);
  apply();
  follow();
  unpacking.then(() => {
    within(document, "details[open]").forEach(fill);
    target()?.scrollIntoView(); // what stands above it has grown
  });
})();
