#include <diffnea/report/identify_page.hpp>
#include <diffnea/report/identify_text.hpp>

namespace diffnea {

std::string identify_page(const FitRun& run) { return "<!doctype html><title>" + identify_headline(run) + "</title>"; }

}  // namespace diffnea
