#pragma once
/// What holds of every page of a report.

#include <cstddef>
#include <regex>
#include <string>

#include <catch2/catch_test_macros.hpp>

namespace diffnea::test {

inline std::size_t count(const std::string& text, const std::string& word) {
  std::size_t out = 0;
  for (std::size_t at = text.find(word); at != text.npos; at = text.find(word, at + 1)) ++out;
  return out;
}

/// Nothing is loaded, no number failed, and what is opened is closed.
inline void check_page(const std::string& page) {
  const std::string markup = page.substr(0, page.find("<script type='application/json' id='data'"));
  const std::string body = markup.substr(markup.find("<body>"));
  CHECK_FALSE(std::regex_search(body, std::regex("src=|href=|url\\(|://")));
  for (const char* failed :
       {"'nan", "'-nan", "'inf", "'-inf", "nan ", ",nan", "[nan", ":nan", ">nan", ">inf", ">-inf"})
    CHECK(count(body, failed) == 0);
  for (const char* tag :
       {"svg", "g", "table", "div", "section", "figure", "script", "p", "tr", "td"})
    CHECK(count(body, std::string("<") + tag + " ") + count(body, std::string("<") + tag + ">") ==
          count(body, std::string("</") + tag + ">"));
}

}  // namespace diffnea::test
