#include <diffnea/diagnose/diagnose.hpp>

#include "report/evidence_plots.hpp"
#include "report/sentence.hpp"

namespace diffnea {

// Declared beside find_causes(), which knows no words: they are chosen here, where pages and texts
// are written.
Finding diagnose(const Model& model, const RecordingSource& train, const RecordingSource* test,
                 const DiagnoseOptions& options) {
  Finding finding = find_causes(model, train, test, options);
  finding.plots = report::evidence_plots(finding);
  finding.sentence = report::sentence(finding);
  return finding;
}

}  // namespace diffnea
