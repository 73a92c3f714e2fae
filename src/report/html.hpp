#pragma once
/// Pieces of HTML. Text from outside goes through `escape`, always.

#include <string>
#include <string_view>
#include <vector>

namespace diffnea::report {

extern const std::string_view kPageStyle, kPageScript;     ///< page.css, page.js
extern const std::string_view kChartLibrary, kChartStyle;  ///< dygraphs, or empty

std::string escape(std::string_view text);
/// JSON that may stand inside a <script>: no tag can end it.
std::string script_json(std::string_view json);
/// <tag>escaped text</tag>
std::string element(const char* tag, std::string_view text, const char* css_class = "");
/// A table with titles and rows of cells that are HTML already; `classes` per column, may be
/// shorter.
std::string html_table(const std::vector<std::string>& titles,
                       const std::vector<std::vector<std::string>>& rows,
                       const std::vector<const char*>& classes);
/// The whole document: nothing that it shows comes from elsewhere, and the browser is told so.
std::string document(const std::string& title, const std::string& body,
                     const std::string& data_json);

}  // namespace diffnea::report
