#pragma once
/// Words and tables of a page as HTML, and the places of its drawings, which page.js fills. Text
/// from outside goes through `escape`, always.

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <diffnea/runs/result.hpp>

namespace diffnea::report {

/// page.html, page.css, and the scripts: strokes.js is before those that draw, page.js is last.
extern const std::string_view kPage, kPageStyle, kStrokes, kTime, kCurves, kBall, kMovement, kDraw,
    kPageScript;

std::string escape(std::string_view text);
/// JSON that may stand inside a <script>: no tag can end it.
std::string script_json(std::string_view json);
/// <tag>escaped text</tag>
std::string element(const char* tag, std::string_view text, const char* css_class = "");
/// A list of texts.
std::string html_list(const std::vector<std::string>& items);
/// A table with titles and rows of cells that are HTML already; `classes` per column, may be
/// shorter.
std::string html_table(const std::vector<std::string>& titles,
                       const std::vector<std::vector<std::string>>& rows,
                       const std::vector<const char*>& classes);

/// Name and value of data-<name>.
using Data = std::vector<std::pair<const char*, std::string>>;
/// The place of a drawing. @param kind  a function of draw.js  @param data  its arguments
std::string drawing(const char* kind, const Data& data, const char* css_class = "drawing",
                    const char* tag = "div");

/// One bar of a list of bars.
struct Bar {
  std::string label, text;  ///< to the left and to the right
  double from = 0.0, to = 0.0;
  const char* css_class = "";
};
/// Bars below each other; a table of their texts until they are drawn.
/// @param knee  0: linear; else logarithmic far above it, with a line there
std::string bars(const std::vector<Bar>& list, double knee = 0.0);

/// The command as a shell takes it, and the files with their checksums.
std::string reproduce(const Reproduce& r);
/// The whole document: nothing that it shows comes from elsewhere, and the browser is told so.
/// @param data  page_data()
std::string document(const std::string& title, const std::string& body, const std::string& data);

}  // namespace diffnea::report
