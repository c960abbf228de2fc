// Filters: they are kept in the address after "#?", so that a view can be shared and restored.
(() => {
  "use strict";
  const form = document.getElementById("filters");
  if (!form) return;
  const names = ["verdict", "tier", "section", "method", "words"];
  const nothing = document.getElementById("nothing");
  const shown = document.getElementById("shown");
  const claims = [...document.querySelectorAll("section.claim")].map((element) => ({
    element,
    verdict: element.dataset.verdict,
    tier: element.dataset.tier,
    sections: JSON.parse(element.dataset.places),
    methods: JSON.parse(element.dataset.methods),
    text: [...element.querySelectorAll("h3, blockquote, .judged, .reason, .because, .where")]
      .map((part) => part.textContent)
      .join(" ")
      .toLowerCase(),
  }));
  const chips = new Map();
  for (const chip of document.querySelectorAll("[data-for]")) chips.set(chip.dataset.for, chip);

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
    for (const tier of document.querySelectorAll("section.tier"))
      tier.hidden = !tier.querySelector("section.claim:not([hidden])");
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
    if (location.hash.startsWith("#?")) return set(new URLSearchParams(location.hash.slice(2)));
    const target = document.getElementById(location.hash.slice(1));
    const evidence = target?.querySelector("details.evidence");
    if (evidence) evidence.open = true;
    if (target?.hidden) {
      set(new URLSearchParams()); // a link to a claim shows it, whatever the filters say
      target.scrollIntoView();
    }
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
  addEventListener("beforeprint", () => {
    for (const evidence of document.querySelectorAll("details.evidence")) evidence.open = true; // paper has no clicks
  });
  apply();
  follow();
})();
