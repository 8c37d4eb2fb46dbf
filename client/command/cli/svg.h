#pragma once

#include <string>
#include <vector>

/// Parts of SVG drawings. Coordinates: px, x to the right, y down.
namespace taclink::command::svg {

/// Opens a drawing of that size on white; the caller appends its elements and "</svg>\n".
std::string Open(double width, double height);
/// `anchor`: start, middle or end. `more`: further attributes, with a blank before them.
std::string Text(double x, double y, const char* anchor, const std::string& text,
                 const std::string& more = "");
std::string Line(double x1, double y1, double x2, double y2, const std::string& style);
/// XML text: characters that have a meaning there are replaced, control characters by '?'.
std::string Escaped(const std::string& text);

/// 1, 2 or 5 times a power of ten: `span` has no more than `most` of them.
double TickStep(double span, int most);
/// Multiples of `step` between the two.
std::vector<double> Ticks(double low, double high, double step);
/// A tick's number, with as many decimals as its step has.
std::string TickText(double value, double step);

}  // namespace taclink::command::svg
