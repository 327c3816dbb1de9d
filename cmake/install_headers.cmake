# Run at installation: copies the headers of `folder` from `source` to `destination`. What they include
# from the repository's root ("solvers/registry.hpp") becomes "graybox/solvers/registry.hpp", so that
# a user's folder of the same name does not come in between.
file(GLOB_RECURSE headers RELATIVE "${source}" "${source}/${folder}/*.hpp")
foreach(header IN LISTS headers)
  file(READ "${source}/${header}" text)
  string(REGEX REPLACE "#include \"(problems|solvers|diagnosis)/" "#include \"graybox/\\1/" text
    "${text}")
  set(before "")
  if(EXISTS "${destination}/${header}")
    file(READ "${destination}/${header}" before)
  endif()
  if(NOT text STREQUAL before)
    file(WRITE "${destination}/${header}" "${text}")
  endif()
endforeach()
