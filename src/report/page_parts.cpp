#include "report/page_parts.hpp"

#include "report/html.hpp"

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

std::string html_list(const std::vector<std::string>& items) {
  std::string out = "<ul>\n";
  for (const std::string& item : items) out += element("li", item);
  return out + "</ul>\n";
}

std::string reproduce(const Reproduce& r) {
  std::string command;
  for (const std::string& argument : r.command)
    command += (command.empty() ? "" : " ") + quoted(argument);
  std::vector<std::vector<std::string>> rows;
  for (const RunInput& i : r.inputs)
    rows.push_back({escape(i.role), "<code>" + escape(i.path) + "</code>", std::to_string(i.bytes),
                    "<code>" + escape(i.sha256) + "</code>"});
  return element("pre", command) +
         html_table({"", "file", "bytes", "SHA-256"}, rows, {"", "wrap", "n", "wrap"}) +
         "<p class='faint'>diffnea " + escape(r.version) + "</p>\n";
}

}  // namespace diffnea::report
