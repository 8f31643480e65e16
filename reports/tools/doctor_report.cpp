#include "reports/tools/doctor_report.h"

#include <fmt/core.h>

#include <algorithm>
#include <functional>

#include "workloads/base/text/json.h"

namespace pirt {
namespace {

std::string summary(const std::vector<Finding>& findings) {
  const auto count = [&](Level level) {
    return std::ranges::count(findings, level, &Finding::level);
  };
  switch (verdict(findings)) {
    case Level::kBlocks:
      return "Nothing can be measured here.";
    case Level::kSpoils:
      return fmt::format("{} of {} checks found what spoils measurements.", count(Level::kSpoils),
                         findings.size());
    default:
      return fmt::format("Nothing found that spoils measurements ({} checks, {} not known).",
                         findings.size(), count(Level::kUnknown));
  }
}

}  // namespace

Document doctor_document(const std::vector<Finding>& findings) {
  std::vector<Finding> sorted = findings;
  std::ranges::stable_sort(sorted, std::greater(), &Finding::level);
  Table table{
      .title = "What affects measurements here",
      .columns = {{"check", Align::kLeft}, {"level", Align::kLeft}, {"found", Align::kLeft}}};
  Paragraph remedies;
  for (const Finding& finding : sorted) {
    table.rows.push_back({finding.check, std::string(to_string(finding.level)), finding.found});
    if (finding.why.empty()) continue;
    remedies.lines.push_back(fmt::format("{}: {}.", finding.check, finding.why));
    if (!finding.remedy.empty()) remedies.lines.push_back("    " + finding.remedy);
  }
  Document document{.title = "pirt doctor", .parts = {table}};
  if (!remedies.lines.empty()) document.parts.emplace_back(remedies);
  document.parts.emplace_back(Paragraph{{summary(findings)}});
  return document;
}

Json doctor_json(const std::vector<Finding>& findings) {
  auto list = Json::array();
  for (const Finding& finding : findings) {
    Json entry = {
        {"check", finding.check}, {"level", to_string(finding.level)}, {"found", finding.found}};
    if (!finding.why.empty()) entry["why"] = finding.why;
    if (!finding.remedy.empty()) entry["remedy"] = finding.remedy;
    list.push_back(std::move(entry));
  }
  return {{"verdict", to_string(verdict(findings))}, {"findings", list}};
}

}  // namespace pirt
