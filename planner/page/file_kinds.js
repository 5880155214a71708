/* Kinds of files that are neither tables nor drawings: their endings, and how they begin.
 *
 * planner/paths/file_kinds.py reads KINDS, too, so its value is JSON. */
import { InputError } from "./words.js";

const KINDS = {
  "GeoJSON": ["geojson topojson",
    "\\{[\\s\\S]*?\"type\"\\s*:\\s*\"(?:Feature|Topology|Geometry|(?:Multi)?(?:Point|Line|Poly))"],
  "JSON": ["json", "\\{|\\[\\s*[\\[{\\d-]"],
  "GPX": ["gpx", "<[\\s\\S]*?<gpx[\\s>]|<gpx[\\s>]"],
  "KML": ["kml kmz", "<[\\s\\S]*?<kml[\\s>]|<kml[\\s>]"],
  "a drawing with another ending than .svg": ["svgz", "<[\\s\\S]*?<svg[\\s/>]|<svg[\\s/>]"],
  "XML": ["xml gml", "<"],
  "G-code": ["gcode gco ngc cnc tap",
    "(?:[%;(O][^\\n]*\\n|\\s)*(?:N\\d+\\s*)?[GM]\\d+(?:\\.\\d+)?(?:\\s|[A-Z;(]|$)"],
  "WKT": ["wkt ewkt",
    "(?:[^\\n]*\\n)?[^\\n(]*?(?:POINT|LINESTRING|RING|POLYGON|COLLECTION)[\\sZM]*\\(+[\\s\\d.+-]"],
  "DXF": ["dxf", "(?:999\\s*\\n[^\\n]*\\n\\s*)*0\\s*\\n\\s*SECTION"],
  "a shapefile": ["shp shx dbf", "\\x00\\x00\\x27\\x0a"],
  "a vector format": ["dwg plt hpgl eps ps ai step stp stl obj", "%!PS|AC10\\d\\d"],
  "PDF": ["pdf", "%PDF"],
  "a picture": ["png jpg jpeg gif bmp tif tiff webp heic", "\\x89PNG|\\xff\\xd8\\xff|GIF8|II\\*|MM\\x00\\*|RIFF"]
};
const HEAD = 4096; // bytes that tell

/* Refuse a file that is neither a table nor a drawing. bytes: its content. */
function refuseOtherKinds(name, bytes) {
  const head = String.fromCharCode(...bytes.subarray(0, HEAD)).replace(/^\xef\xbb\xbf/, "").trimStart();
  const ending = /\.([^.]*)$/.exec(name)?.[1].toLowerCase(), kinds = Object.keys(KINDS);
  const kind = kinds.find((each) => new RegExp(KINDS[each][1], "iy").test(head)) ??
    kinds.find((each) => KINDS[each][0].split(" ").includes(ending));
  if (kind === undefined || (kind === "JSON" && ending === "json")) return; // plan.json
  const words = "give a table with columns x and y, such as CSV, or an SVG drawing";
  throw new InputError(`${name}: ${kind} is not read; ${words}`);
}

export { refuseOtherKinds };
