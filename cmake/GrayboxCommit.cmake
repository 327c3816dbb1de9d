# Run at each build: writes OUTPUT, the C++ file that states the git commit of SOURCE, and only where
# that has changed. Twelve digits and "+" where committed files were changed; "unknown" outside git
# and source archives.
set(commit "unknown")
execute_process(COMMAND git -C "${SOURCE}" rev-parse --show-toplevel
  OUTPUT_VARIABLE top ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE failed)
file(REAL_PATH "${SOURCE}" source)
if(NOT failed AND top STREQUAL source)
  execute_process(COMMAND git -C "${SOURCE}" rev-parse --short=12 HEAD
    OUTPUT_VARIABLE head ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE RESULT_VARIABLE failed)
  execute_process(
    COMMAND git -C "${SOURCE}" status --porcelain --untracked-files=no -- ":!results"
    OUTPUT_VARIABLE changes ERROR_QUIET OUTPUT_STRIP_TRAILING_WHITESPACE)
  if(NOT failed)
    set(commit "${head}")
    if(changes)
      string(APPEND commit "+")
    endif()
  endif()
endif()
# A source archive states the commit that it was made from (.gitattributes).
if(commit STREQUAL "unknown")
  file(STRINGS "${SOURCE}/cmake/archive_commit.txt" stated)
  if(stated MATCHES "^[0-9a-f]+$")
    string(SUBSTRING "${stated}" 0 12 commit)
  endif()
endif()
# Of one length, so that nothing else in the program moves (kCommitField).
string(LENGTH "${commit}" length)
foreach(blank RANGE ${length} 12)
  string(APPEND commit " ")
endforeach()
set(text "#include \"cli/process/build_commit.hpp\"\nconst char* const graybox::cli::kBuildCommit = \"${commit}\";\n")
set(before "")
if(EXISTS "${OUTPUT}")
  file(READ "${OUTPUT}" before)
endif()
if(NOT before STREQUAL text)
  file(WRITE "${OUTPUT}" "${text}")
endif()
