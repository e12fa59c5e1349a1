//! What naga lets pass and devices do not: workgroups that are too large, and barriers that some invocations never reach. Not seen:
//! invocations that leave a loop with a barrier in it at different times.

use naga::{
    AddressSpace, Block, Function, Module, ShaderStage, Span, Statement,
    proc::Layouter,
    valid::{FunctionInfo, ModuleInfo},
};

/// Most invocations of a workgroup: what Vulkan 1.3 devices are sure to have is 128, what all in use have is 256.
pub const MAX_INVOCATIONS: u32 = 256;

/// Most workgroup memory of an entry point in bytes, which every device has.
pub const MAX_WORKGROUP_BYTES: u32 = 16 << 10;

/// All problems, with their places.
pub fn check(module: &Module, info: &ModuleInfo) -> Vec<(Span, String)> {
    let mut problems = Vec::new();
    if !module.overrides.is_empty() {
        problems.push((Span::UNDEFINED, "`override` is not supported; use a `const` or an immediate".into()));
    }
    sizes(module, info, &mut problems);
    // Functions come before who calls them, so whether a callee has a barrier is known at the call.
    let mut with_barrier = vec![false; module.functions.len()];
    for (handle, function) in module.functions.iter() {
        let mut walk = Walk::new(function, &info[handle], &with_barrier);
        walk.block(&function.body, false);
        problems.append(&mut walk.problems);
        with_barrier[handle.index()] = walk.barrier;
    }
    for (i, entry) in module.entry_points.iter().enumerate() {
        let mut walk = Walk::new(&entry.function, info.get_entry_point(i), &with_barrier);
        walk.block(&entry.function.body, false);
        problems.append(&mut walk.problems);
    }
    problems
}

fn sizes(module: &Module, info: &ModuleInfo, problems: &mut Vec<(Span, String)>) {
    let mut layouter = Layouter::default();
    if layouter.update(module.to_ctx()).is_err() {
        return; // the validator has refused such types
    }
    for (i, entry) in module.entry_points.iter().enumerate() {
        if entry.stage != ShaderStage::Compute {
            continue;
        }
        let invocations: u32 = entry.workgroup_size.iter().product();
        if invocations > MAX_INVOCATIONS {
            let text = format!(
                "entry point `{}`: workgroup of {invocations} invocations, the limit is {MAX_INVOCATIONS}",
                entry.name
            );
            problems.push((Span::UNDEFINED, text));
        }
        let used = info.get_entry_point(i);
        let bytes: u32 = module
            .global_variables
            .iter()
            .filter(|(handle, v)| v.space == AddressSpace::WorkGroup && !used[*handle].is_empty())
            .map(|(_, v)| layouter[v.ty].size)
            .sum();
        if bytes > MAX_WORKGROUP_BYTES {
            let text = format!(
                "entry point `{}`: {bytes} bytes of workgroup memory, the limit is {MAX_WORKGROUP_BYTES}",
                entry.name
            );
            problems.push((Span::UNDEFINED, text));
        }
    }
}

/// Walks one function in the order of its text.
struct Walk<'a> {
    function: &'a Function,
    info: &'a FunctionInfo,
    with_barrier: &'a [bool],
    /// A `return` was seen.
    returned: bool,
    /// A barrier was seen, here or in a called function.
    barrier: bool,
    problems: Vec<(Span, String)>,
}

impl<'a> Walk<'a> {
    fn new(function: &'a Function, info: &'a FunctionInfo, with_barrier: &'a [bool]) -> Self {
        Self { function, info, with_barrier, returned: false, barrier: false, problems: Vec::new() }
    }

    /// `divergent`: inside a branch that not all invocations may take.
    fn block(&mut self, block: &Block, divergent: bool) {
        for (statement, span) in block.span_iter() {
            match statement {
                Statement::Return { .. } => self.returned = true,
                Statement::ControlBarrier(_) | Statement::WorkGroupUniformLoad { .. } => {
                    self.reached(*span, divergent)
                }
                Statement::Call { function, .. } if self.with_barrier[function.index()] => {
                    self.reached(*span, divergent)
                }
                Statement::Block(inner) => self.block(inner, divergent),
                Statement::If { condition, accept, reject } => {
                    let divergent = divergent || !self.uniform(*condition);
                    self.block(accept, divergent);
                    self.block(reject, divergent);
                }
                Statement::Switch { selector, cases } => {
                    let divergent = divergent || !self.uniform(*selector);
                    cases.iter().for_each(|case| self.block(&case.body, divergent));
                }
                Statement::Loop { body, continuing, .. } => {
                    let returned = self.returned;
                    self.block(body, divergent);
                    self.block(continuing, divergent);
                    if self.returned != returned {
                        // A `return` inside comes before the barriers of the next round.
                        self.block(body, divergent);
                        self.block(continuing, divergent);
                    }
                }
                _ => {}
            }
        }
    }

    fn uniform(&self, expression: naga::Handle<naga::Expression>) -> bool {
        // What naga knows: constants, immediates, uniforms and the built-ins of the workgroup; anything in a `var` counts as different.
        debug_assert!(expression.index() < self.function.expressions.len());
        self.info[expression].uniformity.non_uniform_result.is_none()
    }

    fn reached(&mut self, span: Span, divergent: bool) {
        self.barrier = true;
        let problem = if self.returned {
            "a barrier after a `return`: invocations that returned never reach it; guard the work instead of returning"
        } else if divergent {
            "a barrier inside a branch that not all invocations may take; move it out"
        } else {
            return;
        };
        self.problems.push((span, problem.into()));
    }
}
