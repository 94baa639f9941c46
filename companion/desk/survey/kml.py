"""KML 2.3 output of the zones (OGC 12-007r2), for Google Earth and ground stations."""

from __future__ import annotations

import html
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as Xml

from shapely.geometry import MultiPolygon, Polygon

from companion.flight.outputs.geojson_features import DEGREE_DECIMALS

NAMESPACE = "http://www.opengis.net/kml/2.2"  # 2.3 uses it, too
# RGB of the ranks, the best first; all later ranks have the last colour.
COLOURS = ("1a9850", "66bd63", "a6d96a", "fdae61", "f46d43", "d73027")
FILL, LINE = "80", "ff"  # opacity
NUMBERED = (
    ("area_m2", "area", "m²"),
    ("certainty", "certainty", ""),
    ("slope_deg", "slope", "°"),
    ("roughness", "roughness", ""),
    ("square_side_m", "side of the largest square", "m"),
    ("clearance_m", "clearance", "m"),
    ("elevation_m", "elevation", "m"),
    ("vertical_datum", "elevation counted from", ""),
    ("point_certainty", "certainty of the point", ""),
    ("obstacles", "obstacles", ""),
    ("surface", "surface", ""),
    ("raised_m", "raised", "m"),
    ("water", "probability of water", ""),
    ("why", "why this rank", ""),
    ("corridors", "ways in and out", ""),
)


def write_kml(path: Path, shapes: Sequence[MultiPolygon], described: Sequence[dict[str, Any]]) -> None:
    """Write each zone as a polygon with holes and its landing point as a placemark.

    Both are clamped to the viewer's ground: no height of another datum puts them above or below it.
    shapes: in longitude and latitude. described: `zone_table.rows`, the best first.
    """
    root = Xml.Element("kml", xmlns=NAMESPACE)
    document = Xml.SubElement(root, "Document")
    _text(document, "name", "Safe landing zones")
    for rank, colour in enumerate(COLOURS, start=1):
        _style(document, f"rank{rank}", colour)
    for shape, row in zip(shapes, described, strict=True):
        folder = Xml.SubElement(document, "Folder")
        _text(folder, "name", f"Zone {row['id']}")
        style = f"#rank{min(row['id'], len(COLOURS))}"
        outline = _placemark(folder, f"Zone {row['id']}", style, row)
        _polygons(outline, shape)
        point = Xml.SubElement(_placemark(folder, f"Landing point {row['id']}", style, row), "Point")
        _text(point, "altitudeMode", "clampToGround")
        _text(point, "coordinates", _place(row["lon"], row["lat"]))
    Xml.indent(root)
    Xml.ElementTree(root).write(path, "utf-8", xml_declaration=True)


def _style(document: Xml.Element, name: str, colour: str) -> None:
    """Add a style; KML writes colours as opacity, blue, green, red."""
    swapped = colour[4:] + colour[2:4] + colour[:2]
    style = Xml.SubElement(document, "Style", id=name)
    _text(Xml.SubElement(style, "IconStyle"), "color", LINE + swapped)
    line = Xml.SubElement(style, "LineStyle")
    _text(line, "color", LINE + swapped)
    _text(line, "width", "2")
    _text(Xml.SubElement(style, "PolyStyle"), "color", FILL + swapped)


def _placemark(folder: Xml.Element, name: str, style: str, row: dict[str, Any]) -> Xml.Element:
    mark = Xml.SubElement(folder, "Placemark")
    _text(mark, "name", name)
    _text(mark, "description", _table(row))
    _text(mark, "styleUrl", style)
    return mark


def _polygons(mark: Xml.Element, shape: MultiPolygon) -> None:
    many = Xml.SubElement(mark, "MultiGeometry")
    for part in shape.geoms:
        _polygon(many, part)


def _polygon(parent: Xml.Element, part: Polygon) -> None:
    polygon = Xml.SubElement(parent, "Polygon")
    _text(polygon, "altitudeMode", "clampToGround")
    for boundary, ring in (
        ("outerBoundaryIs", part.exterior),
        *(("innerBoundaryIs", r) for r in part.interiors),
    ):
        places = " ".join(_place(lon, lat) for lon, lat in ring.coords)
        _text(Xml.SubElement(Xml.SubElement(polygon, boundary), "LinearRing"), "coordinates", places)


def _table(row: dict[str, Any]) -> str:
    """Return the description as an HTML table; unknown values are left out."""
    lines = [
        f"<tr><td>{title}</td><td>{html.escape(str(row[key]))} {unit}</td></tr>"
        for key, title, unit in NUMBERED
        if row.get(key) not in (None, "")
    ]
    return f"<table>{''.join(lines)}</table>"


def _place(lon: float, lat: float) -> str:
    return f"{lon:.{DEGREE_DECIMALS}f},{lat:.{DEGREE_DECIMALS}f}"


def _text(parent: Xml.Element, tag: str, text: str) -> None:
    Xml.SubElement(parent, tag).text = text
