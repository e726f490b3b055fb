#include "core/report.h"

namespace stellate::core {

const char* TerminationName(Termination t) {
  switch (t) {
    case Termination::kRunning:
      return "RUNNING";
    case Termination::kConverged:
      return "CONVERGED";
    case Termination::kVertexBudget:
      return "VERTEX_BUDGET";
    case Termination::kRoundBudget:
      return "ROUND_BUDGET";
    case Termination::kCancelled:
      return "CANCELLED";
    case Termination::kOracleFailed:
      return "ORACLE_FAILED";
    case Termination::kNoProgress:
      return "NO_PROGRESS";
  }
  return "UNKNOWN";
}

const char* CertificateLevelName(CertificateLevel level) {
  switch (level) {
    case CertificateLevel::kRefused:
      return "REFUSED";
    case CertificateLevel::kDecided:
      return "DECIDED";
    case CertificateLevel::kSampled:
      return "SAMPLED";
    case CertificateLevel::kProved:
      return "PROVED";
  }
  return "UNKNOWN";
}

const char* PhaseName(Phase p) {
  switch (p) {
    case Phase::kSeeding:
      return "SEEDING";
    case Phase::kRefining:
      return "REFINING";
    case Phase::kCertifying:
      return "CERTIFYING";
    case Phase::kDone:
      return "DONE";
  }
  return "UNKNOWN";
}

}  // namespace stellate::core
