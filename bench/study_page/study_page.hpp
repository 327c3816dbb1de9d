// The page of a study, index.html beside its rows: one file that loads nothing (html_page.hpp).
//
//   const StudyRows rows = read_rows(folder / "rows.jsonl");
//   write_text_file("index.html", study_page(rows, {.command = "graybox study page ..."}));
//
// It shows the time against Q of every solver (the paper's Figure 3) and two kinds of profiles. All
// points stand in a table that sorts and filters. Each solver has a section with its statuses and
// its worst instance. All of it follows from the rows, also from those of earlier studies.
#pragma once

#include <string>

#include "bench/study/row_file.hpp"
#include "diagnosis/report/html_page.hpp"

namespace graybox::bench {

[[nodiscard]] std::string study_page(const StudyRows& rows, const PageOrigin& origin);

}  // namespace graybox::bench
