#include "report/html.hpp"

namespace diffnea::report {

std::string escape(std::string_view text) {
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string script_json(std::string_view json) {
  std::string out;
  out.reserve(json.size());
  for (const char c : json) {
    if (c == '<') {
      out += "\\u003c";
    } else {
      out += c;
    }
  }
  return out;
}

std::string element(const char* tag, std::string_view text, const char* css_class) {
  std::string out = std::string("<") + tag;
  if (*css_class) out += std::string(" class='") + css_class + "'";
  return out + ">" + escape(text) + "</" + tag + ">\n";
}

std::string html_table(const std::vector<std::string>& titles,
                       const std::vector<std::vector<std::string>>& rows,
                       const std::vector<const char*>& classes) {
  const auto attribute = [&](std::size_t column) {
    return column < classes.size() && *classes[column]
               ? std::string(" class='") + classes[column] + "'"
               : std::string();
  };
  std::string out = "<div class='wide'><table><thead><tr>";
  for (std::size_t c = 0; c < titles.size(); ++c)
    out += "<th" + attribute(c) + ">" + escape(titles[c]) + "</th>";
  out += "</tr></thead><tbody>\n";
  for (const std::vector<std::string>& row : rows) {
    out += "<tr>";
    for (std::size_t c = 0; c < row.size(); ++c)
      out += "<td" + attribute(c) + ">" + row[c] + "</td>";
    out += "</tr>\n";
  }
  return out + "</tbody></table></div>\n";
}

std::string document(const std::string& title, const std::string& body,
                     const std::string& data_json) {
  std::string out =
      R"(<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:">
)";
  out += "<title>" + escape(title) + "</title>\n<style>\n";
  out += kChartStyle;
  out += kPageStyle;
  out += "</style>\n</head>\n<body>\n<main>\n" + body + "</main>\n";
  out += "<script type='application/json' id='data'>" + script_json(data_json) + "</script>\n";
  if (!kChartLibrary.empty()) {
    out += "<script>";
    out += kChartLibrary;
    out += "</script>\n";
  }
  out += "<script>\n";
  out += kPageScript;
  return out + "</script>\n</body>\n</html>\n";
}

}  // namespace diffnea::report
