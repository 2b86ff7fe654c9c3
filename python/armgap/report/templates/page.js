// Charts take their ink from the page's style; what the style sheet does not reach is set here, again when light turns to dark or
// screen to print. Narrow pages fold legends; on touch screens a finger scrolls the page until a tool is chosen.
const NARROW = 600; // px
const models = (...types) => Bokeh.documents.flatMap((doc) => [...doc.all_models].filter((model) => types.includes(model.type)));
function ink() {
  const color = getComputedStyle(document.documentElement).getPropertyValue("--ink").trim();
  for (const legend of models("Legend")) legend.label_text_color = color;
  for (const labels of models("LabelSet")) labels.text_color = { value: color };
  for (const view of Bokeh.index) view.invalidate_all?.();
}
function fold() {
  for (const legend of models("Legend")) legend.ncols = innerWidth < NARROW ? 2 : "auto";
}
function start() {
  if (matchMedia("(pointer: coarse)").matches) for (const tool of models("BoxZoomTool", "PanTool", "WheelZoomTool")) tool.active = false;
  ink();
  fold();
}
document.addEventListener("DOMContentLoaded", () => setTimeout(start));
addEventListener("resize", fold);
for (const query of ["(prefers-color-scheme: dark)", "print"]) matchMedia(query).addEventListener("change", ink);
