// Charts take their ink from the page's style; what the style sheet does not reach is set here, again when light turns to dark.
// Narrow charts fold their legends; on touch screens a finger scrolls the page until a tool is chosen.
const [TINY, NARROW] = [280, 500]; // px
const models = (...types) => Bokeh.documents.flatMap((doc) => [...doc.all_models].filter((model) => types.includes(model.type)));
const plots = () => [...Bokeh.index].filter((view) => view.model.type === "Figure");
function ink() {
  const color = getComputedStyle(document.documentElement).getPropertyValue("--ink").trim();
  for (const legend of models("Legend")) legend.label_text_color = color;
  for (const labels of models("LabelSet")) labels.text_color = { value: color };
  for (const view of plots()) view.invalidate_layout();
}
function fold() {
  for (const view of plots()) {
    const width = view.el.getBoundingClientRect().width;
    const legends = view.model.below.filter((model) => model.type === "Legend");
    for (const legend of legends) legend.ncols = width < TINY ? 1 : width < NARROW ? 2 : "auto";
  }
}
function start() {
  if (matchMedia("(pointer: coarse)").matches) for (const tool of models("BoxZoomTool", "PanTool", "WheelZoomTool")) tool.active = false;
  ink();
  fold();
}
// A printer does not wait for canvases to be painted anew: it gets drawings instead, at the paper's width and in the paper's ink.
function paper() {
  document.documentElement.classList.add("paper");
  ink();
  fold();
  for (const view of plots()) {
    view.invalidate_layout();
    const drawing = view.export("svg", false).ctx.get_svg();
    drawing.setAttribute("viewBox", `0 0 ${drawing.getAttribute("width")} ${drawing.getAttribute("height")}`);
    drawing.classList.add("drawing");
    view.el.parentElement.after(drawing);
  }
}
function screen() {
  for (const drawing of document.querySelectorAll(".drawing")) drawing.remove();
  document.documentElement.classList.remove("paper");
  ink();
  fold();
  for (const view of plots()) view.invalidate_layout();
}
addEventListener("beforeprint", paper);
addEventListener("afterprint", screen);
document.addEventListener("DOMContentLoaded", () => setTimeout(start));
addEventListener("resize", fold);
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", ink);
