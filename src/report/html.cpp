#include "report/html.hpp"

#include "report/format.hpp"

namespace diffnea::report {
namespace {

/// An argument as a shell takes it.
std::string quoted(const std::string& argument) {
  if (!argument.empty() &&
      argument.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"
                                 "-_./=,:@+%") == std::string::npos)
    return argument;
  std::string out = "'";
  for (const char c : argument) out += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return out + "'";
}

}  // namespace

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

std::string html_list(const std::vector<std::string>& items) {
  std::string out = "<ul>\n";
  for (const std::string& item : items) out += element("li", item);
  return out + "</ul>\n";
}

std::string drawing(const char* kind, const Data& data, const char* css_class, const char* tag) {
  std::string out = std::string("<") + tag + " class='" + css_class + "' data-draw='" + kind + "'";
  for (const auto& [key, value] : data)
    out += std::string(" data-") + key + "='" + escape(value) + "'";
  return out + "></" + tag + ">";
}

std::string bars(const std::vector<Bar>& list, double knee) {
  std::string out = "<div class='drawing' data-draw='bars'" +
                    (knee > 0.0 ? " data-knee='" + number(knee) + "'" : "") + "><table>\n";
  for (const Bar& b : list)
    out += std::string("<tr class='") + b.css_class + "' data-from='" + number(b.from, 7) +
           "' data-to='" + number(b.to, 7) + "'><td>" + escape(b.label) + "</td><td>" +
           escape(b.text) + "</td></tr>\n";
  return out + "</table></div>\n";
}

std::string reproduce(const Reproduce& r) {
  std::string command;
  for (const std::string& argument : r.command)
    command += (command.empty() ? "" : " ") + quoted(argument);
  std::vector<std::vector<std::string>> rows;
  for (const RunInput& i : r.inputs)
    rows.push_back({escape(i.role), "<code>" + escape(i.path) + "</code>", std::to_string(i.bytes),
                    "<code>" + escape(i.sha256) + "</code>"});
  return element("h2", "How to get this again") + element("pre", command) +
         html_table({"", "file", "bytes", "SHA-256"}, rows, {"", "wrap", "n", "wrap"}) +
         "<p class='faint'>diffnea " + escape(r.version) + "</p>\n";
}

std::string document(const std::string& title, const std::string& body, const std::string& data) {
  std::string script;
  for (const std::string_view part :
       {kStrokes, kTime, kCurves, kBall, kMovement, kDraw, kPageScript})
    script += part;
  const std::pair<std::string_view, std::string> parts[] = {{"{{title}}", escape(title)},
                                                            {"{{style}}", std::string(kPageStyle)},
                                                            {"{{body}}", body},
                                                            {"{{data}}", script_json(data)},
                                                            {"{{script}}", script}};
  std::string out;
  std::size_t at = 0;
  for (const auto& [place, text] : parts) {  // in the template's order; no text is searched
    const std::size_t found = kPage.find(place, at);
    out += std::string(kPage.substr(at, found - at)) + text;
    at = found + place.size();
  }
  return out + std::string(kPage.substr(at));
}

}  // namespace diffnea::report
