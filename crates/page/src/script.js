"use strict";
// Tables sort by the column whose heading is pressed: numbers by value, what is none last.
for (const table of document.querySelectorAll("table")) {
  const heads = [...table.tHead.rows[table.tHead.rows.length - 1].cells];
  heads.forEach((head, at) => {
    const button = head.querySelector("button");
    if (button) button.addEventListener("click", () => {
      const down = head.getAttribute("aria-sort") === "ascending";
      heads.forEach(other => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", down ? "descending" : "ascending");
      table.classList.add("sorted");
      const key = row => {
        const cell = row.cells[at];
        return cell.dataset.v !== undefined ? Number(cell.dataset.v) : cell.textContent.trim();
      };
      const none = value => typeof value === "string" && (value === "" || value === "—" || value.startsWith("n/c"));
      const rows = [...table.tBodies[0].rows].map(row => [key(row), row]);
      rows.sort(([a], [b]) => {
        if (none(a) || none(b)) return none(a) - none(b);
        const order = typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), undefined, { numeric: true });
        return down ? -order : order;
      });
      table.tBodies[0].append(...rows.map(([, row]) => row));
    });
  });
}
// Pictures: what is shown is a function of four choices.
const viewers = [...document.querySelectorAll(".viewer")].map(box => {
  const part = role => box.querySelector(`[data-role="${role}"]`);
  const { pictures, frames } = JSON.parse(part("data").textContent);
  const choose = { sequence: part("sequence"), frame: part("frame"), left: part("left"), right: part("right") };
  const pair = box.querySelector(".pair");
  const [under, over] = pair.querySelectorAll("img");
  const slide = part("slide"), error = part("error"), crops = part("crops");
  const fill = (select, names, wanted) => {
    select.replaceChildren(...names.map((name, i) => new Option(name, i)));
    const kept = names.indexOf(wanted);
    select.selectedIndex = kept < 0 ? 0 : kept;
  };
  const text = select => select.selectedIndex < 0 ? undefined : select.options[select.selectedIndex].text;
  const sequences = [...new Set(frames.map(frame => frame.sequence))];
  const of = sequence => frames.filter(frame => frame.sequence === sequence);
  const current = () => of(sequences[choose.sequence.selectedIndex])[choose.frame.selectedIndex];
  const place = () => {
    const at = slide.value;
    over.style.clipPath = `inset(0 ${100 - at}% 0 0)`;
    pair.style.setProperty("--at", `${at}%`);
    slide.setAttribute("aria-valuetext", `${at} % of ${text(choose.left)}, the rest ${text(choose.right)}`);
  };
  const show = () => {
    const frame = current();
    const [left, right] = [choose.left, choose.right].map(select => frame.views[select.selectedIndex]);
    const source = view => pictures[error.checked && view.error !== null ? view.error : view.picture];
    const say = view => `${view.label}${view.note ? ", " + view.note : ""}`;
    [[over, left], [under, right]].forEach(([image, view]) => {
      image.src = source(view);
      image.width = frame.size[0];
      image.height = frame.size[1];
      image.alt = `${frame.sequence} ${frame.name}: ${error.checked && view.error !== null ? "error of " : ""}${view.label}`;
    });
    over.hidden = false;
    box.querySelector(".stage").style.setProperty("--ratio", frame.size[0] / frame.size[1]);
    pair.dataset.split = "";
    part("left-name").textContent = "◧ " + say(left);
    part("right-name").textContent = say(right) + " ◨";
    crops.replaceChildren(...frame.crops.map(row => {
      const line = document.createElement("div");
      line.className = "row";
      row.forEach((picture, i) => {
        const figure = document.createElement("figure"), image = new Image(), caption = document.createElement("figcaption");
        image.src = pictures[picture];
        image.alt = `where the variants differ most: ${frame.views[i].label}`;
        caption.textContent = frame.views[i].label;
        figure.append(image, caption);
        line.append(figure);
      });
      return line;
    }));
    place();
  };
  const fillViews = () => {
    const labels = current().views.map(view => view.label);
    const right = text(choose.right);
    fill(choose.left, labels, text(choose.left));
    fill(choose.right, labels, right);
    if (right === undefined) choose.right.selectedIndex = labels.length - 1;
    show();
  };
  const fillFrames = wanted => {
    fill(choose.frame, of(sequences[choose.sequence.selectedIndex]).map(frame => frame.name), wanted ?? text(choose.frame));
    fillViews();
  };
  fill(choose.sequence, sequences);
  fillFrames();
  choose.sequence.addEventListener("change", () => fillFrames());
  choose.frame.addEventListener("change", fillViews);
  [choose.left, choose.right, error].forEach(input => input.addEventListener("change", show));
  slide.addEventListener("input", place);
  const drag = event => {
    if (event.buttons !== 1) return;
    const { left, width } = pair.getBoundingClientRect();
    slide.value = 100 * (event.clientX - left) / width;
    place();
    event.preventDefault();
  };
  pair.addEventListener("pointerdown", drag);
  pair.addEventListener("pointermove", drag);
  const step = (select, by, after) => {
    select.selectedIndex = (select.selectedIndex + by + select.options.length) % select.options.length;
    after();
  };
  box.addEventListener("keydown", event => {
    if (event.target !== box) return;
    const act = {
      ArrowLeft: () => step(choose.frame, -1, fillViews), ArrowRight: () => step(choose.frame, 1, fillViews),
      ArrowUp: () => step(choose.right, -1, show), ArrowDown: () => step(choose.right, 1, show),
      e: () => { error.checked = !error.checked; show(); },
    }[event.key];
    if (act) { act(); event.preventDefault(); }
  });
  return {
    box,
    open(sequence, name, label) {
      const found = frames.find(frame => frame.sequence === sequence && frame.name === name);
      if (!found) return false;
      choose.sequence.selectedIndex = sequences.indexOf(sequence);
      fillFrames(name);
      const view = found.views.findIndex(view => view.label === label);
      if (view >= 0) { choose.right.selectedIndex = view; show(); }
      box.scrollIntoView({ block: "start" });
      box.focus({ preventScroll: true });
      return true;
    },
  };
});
// Points of charts lead to their frame and variant, in the viewer of their own section first.
document.addEventListener("click", event => {
  const link = event.target.closest("a[data-frame]");
  if (!link) return;
  event.preventDefault();
  const near = viewers.filter(viewer => viewer.box.closest("section") === link.closest("section"));
  [...near, ...viewers].some(viewer => viewer.open(link.dataset.sequence, link.dataset.frame, link.dataset.label));
});
// Charts with several views: all of a section that have the chosen one show it.
document.addEventListener("click", event => {
  const button = event.target.closest(".switch button");
  if (!button) return;
  for (const box of button.closest("section").querySelectorAll(".views")) {
    const views = [...box.querySelectorAll("[data-view]")];
    if (!views.some(view => view.dataset.view === button.textContent)) continue;
    views.forEach(view => { view.hidden = view.dataset.view !== button.textContent; });
    box.querySelectorAll(".switch button").forEach(own => own.setAttribute("aria-pressed", own.textContent === button.textContent));
  }
});
// On paper everything is unfolded.
addEventListener("beforeprint", () => document.querySelectorAll("details").forEach(fold => { fold.open = true; }));
