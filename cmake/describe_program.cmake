# What the program says of itself, for those who look elsewhere than in its help: its manual page, completion for shells,
# and JSON Schemas: cmake -D PROGRAM=… -D FOLDER=… -P describe_program.cmake. Files lie as below PREFIX/share.
cmake_minimum_required(VERSION 3.25)

function(keep file)
  get_filename_component(folder "${FOLDER}/${file}" DIRECTORY)
  file(MAKE_DIRECTORY "${folder}")
  execute_process(COMMAND "${PROGRAM}" ${ARGN} OUTPUT_FILE "${FOLDER}/${file}" COMMAND_ERROR_IS_FATAL ANY)
endfunction()

keep(man/man1/pendula.1 help --man)
keep(bash-completion/completions/pendula completion bash)
keep(zsh/site-functions/_pendula completion zsh)
keep(fish/vendor_completions.d/pendula.fish completion fish)
keep(pendula/scenario.schema.json help scenario --json)
keep(pendula/summary.schema.json help summary --json)
